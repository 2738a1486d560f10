import { Select, Stack } from "@mantine/core";
import { useState } from "react";
import type { Hand, SessionView } from "./session";
import { ToolForm } from "./ToolForm";

/** Every tool there is, with a field for each of its arguments. */
export function ToolsPanel({ hand, view }: { hand: Hand; view: SessionView }) {
  const [name, setName] = useState("get_machine_summary");
  return (
    <Stack gap="sm">
      <Select
        label="Tool"
        searchable
        data={view.tools.map((one) => one.name)}
        value={name}
        allowDeselect={false}
        onChange={(value) => setName(value ?? name)}
      />
      <ToolForm
        key={`${name} ${hand.machine} ${hand.part?.id ?? ""} ${hand.face?.label ?? ""}`}
        tool={view.tools.find((one) => one.name === name)}
        hand={hand}
        view={view}
      />
    </Stack>
  );
}
