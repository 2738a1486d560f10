import { Code, MultiSelect, Stack, Text, Title } from "@mantine/core";
import { useMemo, useState } from "react";
import type { Clock } from "./clock";
import { Curves } from "./Curves";
import { firstNames, pilotingCurves } from "./curves";
import type { Piloting } from "./trial";

const MOST = 12;

/** A program beside its trial: what it sensed and asked for over time, and its text. */
export function PilotingView({
  piloting,
  times,
  program,
  clock,
}: {
  piloting: Piloting;
  times: Float64Array;
  program: string;
  clock: Clock;
}) {
  const [names, setNames] = useState(() => firstNames(piloting));
  const curves = useMemo(() => pilotingCurves(piloting, names), [piloting, names]);
  return (
    <Stack gap="xs" role="region" aria-label="Program">
      <Title order={4}>Program</Title>
      <MultiSelect
        label="Over time"
        description="What it sensed, and how far it asked for actions"
        data={[
          { group: "Asked for", items: [...piloting.actionNames] },
          { group: "Sensed", items: [...piloting.senseNames] },
        ]}
        value={names}
        onChange={setNames}
        maxValues={MOST}
        searchable
        clearable
      />
      <Curves curves={curves} times={times} now={clock.shown} breaks={[]} seek={clock.seek} />
      {program !== "" && (
        <details>
          <Text component="summary" size="sm">
            Its text
          </Text>
          <Code block style={{ maxHeight: 400, overflow: "auto" }}>
            {program}
          </Code>
        </details>
      )}
    </Stack>
  );
}
