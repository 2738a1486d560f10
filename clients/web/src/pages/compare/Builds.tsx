import { ActionIcon, Group, SimpleGrid, Slider, Stack, Text } from "@mantine/core";
import { IconChevronLeft, IconChevronRight } from "@tabler/icons-react";
import { useQueries } from "@tanstack/react-query";
import { useMemo, useState } from "react";
import type { JobDetail } from "../../api/queries";
import { Empty, Loading } from "../../parts/States";
import BuildScene from "../../scene/BuildScene";
import { CameraLock } from "../../scene/lock";
import { replay as replayQuery } from "../job/queries";
import { builtAt, ghostsOf, rangeOf, stepsOf, touchedBy, type Replay } from "../job/replay";

/** Two machines that grow in step, seen by cameras that turn together. */
export default function Builds({ jobs }: { jobs: readonly [JobDetail, JobDetail] }) {
  const [first, second] = useQueries({ queries: [replayQuery(jobs[0].id), replayQuery(jobs[1].id)] });
  if (first.data === undefined || second.data === undefined)
    return first.isError || second.isError ? <Empty title="The builds could not be read" /> : <Loading rows={10} />;
  return <InStep replays={[first.data, second.data]} />;
}

function InStep({ replays }: { replays: readonly [Replay | null, Replay | null] }) {
  const lock = useMemo(() => new CameraLock(), []);
  const steps = useMemo(() => replays.map((one) => (one === null ? [] : stepsOf(one))), [replays]);
  const last = Math.max(...steps.map((one) => one.length)) - 1;
  const [at, setAt] = useState(last);
  if (last < 0) return <Empty title="Neither built anything" />;
  const go = (to: number): void => {
    setAt(Math.min(last, Math.max(0, to)));
  };
  return (
    <Stack gap="xs">
      <SimpleGrid cols={{ base: 1, sm: 2 }}>
        {steps.map((own, side) => (
          <OneBuild
            key={side}
            name={side === 0 ? "A" : "B"}
            steps={own}
            at={Math.min(at, own.length - 1)}
            lock={lock}
          />
        ))}
      </SimpleGrid>
      <Group wrap="nowrap" gap="xs">
        <ActionIcon
          variant="default"
          size="lg"
          aria-label="One step back"
          disabled={at === 0}
          onClick={() => {
            go(at - 1);
          }}
        >
          <IconChevronLeft size={18} aria-hidden />
        </ActionIcon>
        <ActionIcon
          variant="default"
          size="lg"
          aria-label="One step on"
          disabled={at === last}
          onClick={() => {
            go(at + 1);
          }}
        >
          <IconChevronRight size={18} aria-hidden />
        </ActionIcon>
        <Slider
          style={{ flex: 1 }}
          min={0}
          max={last}
          value={at}
          onChange={go}
          label={(value) => `step ${value + 1}`}
          thumbLabel="Step of both builds"
        />
        <Text size="sm" className="figures">
          {at + 1} / {last + 1}
        </Text>
      </Group>
    </Stack>
  );
}

function OneBuild({
  name,
  steps,
  at,
  lock,
}: {
  name: string;
  steps: ReturnType<typeof stepsOf>;
  at: number;
  lock: CameraLock;
}) {
  const step = steps[at];
  const parts = useMemo(() => builtAt(steps, at).parts, [steps, at]);
  const whole = useMemo(() => builtAt(steps, rangeOf(steps, step?.chapter ?? -1)?.[1] ?? -1).parts, [steps, step]);
  const ghosts = useMemo(() => ghostsOf(step), [step]);
  const marked = useMemo(() => (at === steps.length - 1 ? new Set<string>() : touchedBy(step)), [at, steps, step]);
  return (
    <div>
      <BuildScene
        parts={parts}
        whole={whole}
        ghosts={ghosts}
        chosen={marked}
        subject={String(step?.chapter)}
        label={`${name} after step ${at + 1}: ${parts.size} parts`}
        height={340}
        lock={lock}
      />
      <Text size="xs" mt={4}>
        <b>{name}</b>{" "}
        {step === undefined
          ? "built nothing"
          : `step ${at + 1} of ${steps.length}: ${step.action}, ${step.accepted ? "accepted" : `refused (${step.reason?.replaceAll("_", " ") ?? ""})`}; ${parts.size} parts`}
      </Text>
    </div>
  );
}
