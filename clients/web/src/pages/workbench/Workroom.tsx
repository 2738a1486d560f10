import {
  Alert,
  Badge,
  Button,
  Code,
  Group,
  Modal,
  Select,
  Spoiler,
  Stack,
  Switch,
  Tabs,
  Text,
  TextInput,
  Title,
} from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { IconArrowBackUp, IconArrowForwardUp, IconRocket } from "@tabler/icons-react";
import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { lazy, Suspense, useEffect, useState } from "react";
import { client, taken } from "../../api/client";
import { task as taskQuery } from "../../api/queries";
import { bytes, count, counted, number, words } from "../../format";
import { Choices } from "../../parts/Choices";
import { Markdown } from "../../parts/Markdown";
import { ProblemNote } from "../../parts/Problem";
import { Loading } from "../../parts/States";
import { callLine } from "../job/transcript";
import { AttachPanel } from "./AttachPanel";
import { FeedbackLog } from "./FeedbackLog";
import { KeysPanel } from "./KeysPanel";
import { PartPanel } from "./PartPanel";
import { Practice } from "./Practice";
import { ProgramPanel, takesPrograms } from "./ProgramPanel";
import {
  ASSEMBLY,
  MAIN,
  rememberSession,
  session as sessionQuery,
  useHand,
  type Hand,
  type SessionView,
} from "./session";
import type { Scenario } from "../../scene/Surroundings";
import { TestTrials } from "./TestTrials";
import { ToolsPanel } from "./ToolsPanel";

const HandScene = lazy(() => import("../../scene/HandScene"));
const DURATION_S = 10;
const HEADING = /^\s*#[^\n]*\n+/;

interface TaskDocument {
  constraints?: { modules?: string[] | null; max_sub_structures?: number };
  scenario?: { duration_s?: number } & Partial<Scenario>;
}

/** The open session: the machine, what is in hand, the tools. */
export function Workroom({ view }: { view: SessionView }) {
  const { job } = view;
  const hand = useHand(view);
  const task = useQuery(taskQuery(job.task, job.task_version));
  const document = (task.data?.document ?? {}) as TaskDocument;
  const [course, setCourse] = useState(true);
  useEffect(() => {
    rememberSession(job.id);
  }, [job.id]);
  return (
    <Stack gap="md">
      <Group justify="space-between" align="start">
        <div>
          <Title order={1}>
            {job.task} by {job.model}
          </Title>
          <Text size="sm" className="dimmed">
            seed {job.seed} · {count(view.calls)} of {count(view.limits.calls)} actions · {bytes(view.bytes)} of{" "}
            {bytes(view.limits.session_bytes)} · cancelled after {view.limits.idle_s / 3600} h without an action
          </Text>
        </div>
        <SubmitButton view={view} />
      </Group>
      {task.data !== undefined && (
        <Spoiler maxHeight={56} showLabel="Read the whole task" hideLabel="Less of the task">
          <Markdown text={task.data.statement.replace(HEADING, "")} />
        </Spoiler>
      )}
      <TestTrials view={view} />
      <Machines hand={hand} view={view} several={(document.constraints?.max_sub_structures ?? 1) > 1} />
      <div className="hand-room">
        <Stack gap="xs">
          <Suspense fallback={<Loading rows={10} />}>
            <HandScene
              parts={hand.bench.parts}
              part={hand.part}
              face={hand.face}
              from={hand.fromFace}
              onPick={hand.choose}
              ghost={hand.ghost}
              subject={hand.machine}
              course={course ? ((document.scenario as Scenario | undefined) ?? null) : null}
              label={`The machine under construction: ${counted(hand.bench.parts.length, "part")}`}
            />
          </Suspense>
          <Group gap="xs">
            <Button
              size="compact-xs"
              variant="default"
              leftSection={<IconArrowBackUp size={14} aria-hidden />}
              disabled={hand.undo === null || hand.busy}
              onClick={() => hand.undo?.()}
            >
              Undo
            </Button>
            <Button
              size="compact-xs"
              variant="default"
              leftSection={<IconArrowForwardUp size={14} aria-hidden />}
              disabled={hand.redo === null || hand.busy}
              onClick={() => hand.redo?.()}
            >
              Redo
            </Button>
          </Group>
          <Switch
            size="sm"
            label="Show the course around it"
            checked={course}
            onChange={(event) => setCourse(event.currentTarget.checked)}
          />
          <Text size="xs" className="dimmed">
            Click a face to choose it; drag to turn, scroll to come closer. Green: free, orange: taken, blue: where a
            connector begins. The red block is the starting block; north is away from you at first.
          </Text>
          <Latest hand={hand} />
          <Practice view={view} />
        </Stack>
        <Stack gap="sm" className="hand-tools">
          <PartsList hand={hand} />
          <Tabs defaultValue="attach" keepMounted={false}>
            <Tabs.List>
              <Tabs.Tab value="attach">Attach</Tabs.Tab>
              <Tabs.Tab value="part">Part</Tabs.Tab>
              <Tabs.Tab value="keys">Keys</Tabs.Tab>
              {takesPrograms(view) && <Tabs.Tab value="program">Program</Tabs.Tab>}
              <Tabs.Tab value="tools">All tools</Tabs.Tab>
            </Tabs.List>
            <Tabs.Panel value="attach" pt="sm">
              <AttachPanel hand={hand} task={{ name: view.job.task, version: view.job.task_version }} />
            </Tabs.Panel>
            <Tabs.Panel value="part" pt="sm">
              <PartPanel hand={hand} view={view} />
            </Tabs.Panel>
            <Tabs.Panel value="keys" pt="sm">
              <KeysPanel hand={hand} view={view} duration={document.scenario?.duration_s ?? DURATION_S} />
            </Tabs.Panel>
            <Tabs.Panel value="program" pt="sm">
              <ProgramPanel key={hand.machine} hand={hand} />
            </Tabs.Panel>
            <Tabs.Panel value="tools" pt="sm">
              <ToolsPanel hand={hand} view={view} />
            </Tabs.Panel>
          </Tabs>
        </Stack>
        <FeedbackLog id={job.id} />
      </div>
    </Stack>
  );
}

function PartsList({ hand }: { hand: Hand }) {
  const { bench, part, face } = hand;
  if (bench.parts.length === 0) return null;
  return (
    <Stack gap={6}>
      <Text size="sm" fw={600}>
        {counted(bench.parts.length, "part")}, mass {number(bench.mass, 2)}
        {bench.detached.length > 0 && (
          <Badge color="orange" ml={8} tt="none" variant="outline" styles={{ root: { color: "inherit" } }}>
            not joined: {bench.detached.join(", ")}
          </Badge>
        )}
      </Text>
      <Choices
        label="Parts"
        value={part?.id}
        onChange={(id) => hand.choose(id)}
        choices={bench.parts.map((one) => ({
          id: one.id,
          text: `${one.id} ${one.module}`,
          note:
            one.sits_on === null
              ? one.ends.length > 0
                ? one.ends.map((end) => end.join("/")).join(" to ")
                : undefined
              : `on ${one.sits_on.join("/")}`,
        }))}
      />
      {part !== undefined && part.faces.length > 0 && (
        <>
          <Text size="sm" fw={600}>
            Faces of {part.id}
          </Text>
          <Choices
            wide
            label={`Faces of part ${part.id}`}
            value={face?.label}
            onChange={(label) => hand.choose(part.id, label)}
            choices={part.faces.map((one) => ({
              id: one.label,
              text: `${one.label} ${one.side}`,
              note: one.taken_by === null ? "free" : `taken by ${one.taken_by}`,
            }))}
          />
        </>
      )}
    </Stack>
  );
}

/** The result of the last action, in the words that a model reads. */
function Latest({ hand }: { hand: Hand }) {
  const { result, error } = hand;
  return (
    <div role="status" data-result={result === undefined ? undefined : result.outcome.ok ? "accepted" : "refused"}>
      {error !== null && <ProblemNote error={error} />}
      {error === null && result !== undefined && (
        <Alert
          color={result.outcome.ok ? "teal" : "red"}
          py="xs"
          title={result.outcome.ok ? "✓ accepted" : `✗ refused: ${words(result.outcome.reason ?? "")}`}
        >
          <Code style={{ overflowWrap: "anywhere" }}>
            {callLine({ name: result.tool, arguments: result.arguments })}
          </Code>
          <Text size="sm" style={{ whiteSpace: "pre-wrap", overflowWrap: "anywhere" }}>
            {result.outcome.feedback}
          </Text>
        </Alert>
      )}
    </div>
  );
}

function Machines({ hand, view, several }: { hand: Hand; view: SessionView; several: boolean }) {
  const [fresh, setFresh] = useState("");
  if (!several && view.machines.length < 2) return null;
  const names = [...new Set([...view.machines.map((one) => one.name), hand.machine, MAIN, ASSEMBLY])];
  const good = /^[A-Za-z0-9_-]{1,40}$/.test(fresh);
  return (
    <Group align="end" gap="sm">
      <Select
        label="Selected machine"
        data={names}
        value={hand.machine}
        allowDeselect={false}
        onChange={(value) => {
          if (value !== null) hand.setMachine(value);
        }}
        w={180}
      />
      <TextInput
        label="Another sub-structure"
        placeholder="tower"
        value={fresh}
        onChange={(event) => setFresh(event.currentTarget.value)}
        error={fresh !== "" && !good ? "Letters, digits, - and _" : null}
        w={180}
      />
      <Button
        variant="default"
        disabled={!good}
        onClick={() => {
          hand.setMachine(fresh);
          setFresh("");
        }}
      >
        Begin it
      </Button>
      <Text size="xs" className="dimmed" maw={420}>
        Sub-structures are built one by one; the assembly is put together from copies of them with add_machine, as they
        are when it is begun.
      </Text>
    </Group>
  );
}

function SubmitButton({ view }: { view: SessionView }) {
  const queries = useQueryClient();
  const [asking, question] = useDisclosure(false);
  const { id } = view.job;
  const submitting = useMutation({
    mutationFn: () => taken(client.POST("/v1/sessions/{session_id}/submit", { params: { path: { session_id: id } } })),
    onSuccess: () => queries.invalidateQueries({ queryKey: sessionQuery(id).queryKey }),
  });
  return (
    <>
      <Button
        leftSection={<IconRocket size={16} aria-hidden />}
        disabled={view.machines.length === 0}
        onClick={question.open}
      >
        Start the trial
      </Button>
      <Modal opened={asking} onClose={question.close} title="Start the trial?">
        <Stack gap="sm">
          <Text size="sm">The current machine is simulated once and scored. The session ends with it.</Text>
          {submitting.isError && <ProblemNote error={submitting.error} />}
          <Group justify="end">
            <Button variant="default" onClick={question.close}>
              Build on
            </Button>
            <Button loading={submitting.isPending} onClick={() => submitting.mutate()} data-autofocus>
              Start it
            </Button>
          </Group>
        </Stack>
      </Modal>
    </>
  );
}
