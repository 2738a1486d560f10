import { Select } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { simulators } from "../api/queries";

interface Choice {
  names: readonly string[];
  /** The chosen one; the service's default until then, "" before that is known. */
  value: string;
  choose: (name: string) => void;
}

/** The choice among the simulators that the service knows. */
export function useSimulator(): Choice {
  const [chosen, choose] = useState<string>();
  const known = useQuery(simulators()).data ?? [];
  const value = chosen ?? known.find((one) => one.default)?.name ?? "";
  return { names: known.map((one) => one.name), value, choose };
}

export function SimulatorSelect({ choice }: { choice: Choice }) {
  return (
    <Select
      label="Simulator"
      data={choice.names}
      value={choice.value}
      allowDeselect={false}
      w={130}
      onChange={(name) => {
        if (name !== null) choice.choose(name);
      }}
    />
  );
}
