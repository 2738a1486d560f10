import { Alert, Button, Group, List, Select, Stack, Text, Title } from "@mantine/core";
import { IconFileUpload, IconPlayerPlay } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { SimulatorSelect, useSimulator } from "../../parts/SimulatorSelect";
import { lazy, Suspense, useState } from "react";
import { tasks as tasksQuery } from "../../api/queries";
import { bytes, number } from "../../format";
import { DropZone } from "../../parts/DropZone";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Loading } from "../../parts/States";
import { Tried } from "../workbench/Tried";
import { useLook, useTrial, type Check, type Dropped } from "./files";

const FileScene = lazy(() => import("../../scene/FileScene"));
const GlbScene = lazy(() => import("../../scene/GlbScene"));
const FIRST = "support-1";

/** A machine from a file: looked at, checked, tried. */
export default function MachinePage() {
  const look = useLook();
  const trial = useTrial();
  const [task, setTask] = useState(FIRST);
  const open = (file: File | null, of = task): void => {
    if (file == null) return;
    trial.reset();
    look.mutate({ file, task: of });
  };
  const dropped = look.data;
  return (
    <Stack gap="md">
      <div>
        <Title order={1}>A machine from a file</Title>
        <Text maw={720}>
          Look at a machine, read what is wrong with it, and put it through a task&apos;s trial. Nothing in a file is
          run; what you try stands on no leaderboard.
        </Text>
      </div>
      <DropZone
        icon={<IconFileUpload size={32} aria-hidden />}
        title="Drop a machine document (JSON), a machine file of the game (.bsg) or a GLB here"
        hint="Machines up to 2 MiB and 2,000 parts, GLB up to 16 MiB."
        label="Machine file"
        accept=".json,.bsg,.glb,application/json,model/gltf-binary"
        busy={look.isPending}
        onFile={(file) => {
          open(file);
        }}
      />
      {look.isError && <ProblemNote error={look.error} />}
      {look.data !== undefined && (
        <Section
          title={look.data.file.name}
          aside={
            <Text size="sm" className="dimmed">
              {bytes(look.data.file.size)}
            </Text>
          }
        >
          <Suspense fallback={<Loading rows={8} />}>
            <Shown dropped={look.data} />
          </Suspense>
        </Section>
      )}
      {dropped?.check != null && (
        <Section title="Trial">
          <Stack gap="sm">
            <Try
              check={dropped.check}
              task={task}
              setTask={(value) => {
                setTask(value);
                open(dropped.file, value);
              }}
              start={(simulator) => {
                trial.mutate({ file: dropped.file, task, simulator });
              }}
              busy={trial.isPending}
            />
            {trial.isError && <ProblemNote error={trial.error} />}
            {trial.data !== undefined && <Tried key={trial.data.id} id={trial.data.id} />}
          </Stack>
        </Section>
      )}
    </Stack>
  );
}

function Shown({ dropped }: { dropped: Dropped }) {
  const { file, glb, check } = dropped;
  if (glb !== null) {
    return (
      <Stack gap="xs">
        <GlbScene root={glb.root} bounds={glb.bounds} label={`The shapes of ${file.name}`} />
        <Text size="sm">
          {glb.nodes} nodes. A GLB holds shapes only, drawn here without pictures: to check or try a machine, drop its
          document or .bsg file.
        </Text>
      </Stack>
    );
  }
  if (check === null) return null;
  return (
    <Stack gap="xs">
      <FileScene scene={check.scene} label={`The machine of ${file.name}: ${check.parts} parts`} />
      <Findings check={check} />
    </Stack>
  );
}

function Findings({ check }: { check: Check }) {
  const sound = check.faults.length === 0;
  const size =
    check.bounds === null ? null : check.bounds[1].map((high, axis) => high - (check.bounds?.[0][axis] ?? 0));
  const remarks = [
    ...check.remarks,
    ...(check.detached.length > 0 ? [`not joined to the starting block: ${check.detached.join(", ")}`] : []),
  ];
  return (
    <Stack gap="xs">
      <Text size="sm" className="figures">
        {check.name !== "" && <b>{check.name}: </b>}
        {check.parts} parts, mass {number(check.mass, 2)}
        {size !== null && `, ${size.map((value) => number(value, 2)).join(" × ")} units (east × north × up)`},{" "}
        {check.control_sequence.length} key press{check.control_sequence.length === 1 ? "" : "es"}
      </Text>
      <Alert color={sound ? "teal" : "red"} py="xs" title={sound ? "✓ it is a sound machine" : "✗ it cannot be tried"}>
        {sound ? (
          "No two blocks overlap, and every part sits where the document says."
        ) : (
          <List size="sm">
            {check.faults.map((one) => (
              <List.Item key={one}>{one}</List.Item>
            ))}
          </List>
        )}
      </Alert>
      {remarks.length > 0 && (
        <Alert color="yellow" py="xs" title={`${remarks.length} remark${remarks.length > 1 ? "s" : ""}`}>
          <List size="sm" style={{ maxHeight: 200, overflow: "auto" }}>
            {remarks.map((one) => (
              <List.Item key={one}>{one}</List.Item>
            ))}
          </List>
        </Alert>
      )}
    </Stack>
  );
}

function Try({
  check,
  task,
  setTask,
  start,
  busy,
}: {
  check: Check;
  task: string;
  setTask: (task: string) => void;
  start: (simulator: string) => void;
  busy: boolean;
}) {
  const tasks = useQuery(tasksQuery());
  const simulator = useSimulator();
  return (
    <>
      <Group align="end" gap="sm">
        <Select
          label="Task"
          searchable
          data={(tasks.data ?? []).map((one) => ({ value: one.name, label: `${one.name}: ${one.title}` }))}
          value={task}
          allowDeselect={false}
          onChange={(value) => {
            if (value !== null) setTask(value);
          }}
          w={{ base: "100%", xs: 320 }}
        />
        <SimulatorSelect choice={simulator} />
        <Button
          leftSection={<IconPlayerPlay size={16} aria-hidden />}
          loading={busy}
          disabled={check.faults.length > 0}
          onClick={() => {
            start(simulator.value);
          }}
        >
          Start the trial
        </Button>
      </Group>
      {check.broken_rule !== null && (
        <Text size="sm">
          It breaks a rule of {task}: {check.broken_rule}. Its trial would end there.
        </Text>
      )}
    </>
  );
}
