import { Alert, Button, Group, Loader, Select, Stack, Text, TextInput } from "@mantine/core";
import { IconPlayerPlay, IconPlayerStop } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { lazy, Suspense, useEffect, useState } from "react";
import { tasks as tasksQuery } from "../../api/queries";
import { number, words } from "../../format";
import { Section } from "../../parts/Section";
import { SimulatorSelect, useSimulator } from "../../parts/SimulatorSelect";
import { Loading } from "../../parts/States";
import { Tried } from "../workbench/Tried";
import { motionOf, type Live } from "../../scene/live";
import { keyOf } from "./keys";
import { Pad } from "./Pad";
import { useDrive, type Drive, type Ended } from "./useDrive";

const DriveScene = lazy(() => import("../../scene/DriveScene"));
const FREE = "";
const NAME = "buildarena-name";
const TELL_EVERY_MS = 100;

/** One machine, driven as often as somebody likes. */
export function DriveRoom({ machine, task: first }: { machine: Record<string, unknown>; task: string | undefined }) {
  const drive = useDrive();
  const [task, setTask] = useState(first ?? FREE);
  const [name, setName] = useState("");
  const simulator = useSimulator();
  const tasks = useQuery(tasksQuery());
  const begin = (): void => {
    if (name.trim() !== "") localStorage.setItem(NAME, name.trim());
    drive.begin({
      machine,
      task: task === FREE ? null : task,
      simulator: simulator.value,
      driver: task === FREE || name.trim() === "" ? null : name.trim(),
    });
  };
  const busy = drive.phase === "opening" || drive.phase === "driving";
  return (
    <Stack gap="md">
      <Group align="end" gap="sm">
        <Select
          label="Where"
          searchable
          disabled={busy}
          data={[
            { value: FREE, label: "Free ground, 2 minutes" },
            ...(tasks.data ?? []).map((one) => ({ value: one.name, label: `${one.name}: ${one.title}` })),
          ]}
          value={task}
          allowDeselect={false}
          onChange={(value) => {
            setTask(value ?? FREE);
          }}
          w={{ base: "100%", xs: 320 }}
        />
        <TextInput
          label="Your name on the board"
          description="Without one it is practice, and counts for nothing"
          placeholder={localStorage.getItem(NAME) ?? "ada"}
          maxLength={80}
          disabled={busy || task === FREE}
          value={name}
          onChange={(event) => {
            setName(event.currentTarget.value);
          }}
          w={{ base: "100%", xs: 260 }}
        />
        <SimulatorSelect choice={simulator} />
        {!busy && (
          <Button leftSection={<IconPlayerPlay size={16} aria-hidden />} onClick={begin}>
            {drive.phase === "ended" ? "Drive again" : "Begin"}
          </Button>
        )}
      </Group>
      {drive.problem !== null && (
        <Alert color="red" role="alert" title="No drive">
          {drive.problem}
        </Alert>
      )}
      {drive.phase === "opening" && (
        <Alert color="blue" role="status" icon={<Loader size="sm" />} title="The machine is put in its place" />
      )}
      {drive.ready?.scene.machine != null && drive.live !== null && <Seat drive={drive} />}
      {drive.ended !== null && <Over ended={drive.ended} />}
    </Stack>
  );
}

/** The view ahead, and the keys in hand. */
function Seat({ drive }: { drive: Drive }) {
  const { ready, live, phase, hold, release } = drive;
  const driving = phase === "driving";
  useEffect(() => {
    if (!driving) return;
    const press = (event: KeyboardEvent): void => {
      const key = keyOf(event.code);
      if (key === null || isTyping(event.target)) return;
      event.preventDefault();
      hold(key, event.type === "keydown");
    };
    window.addEventListener("keydown", press);
    window.addEventListener("keyup", press);
    // Who looks elsewhere holds nothing.
    window.addEventListener("blur", release);
    return () => {
      window.removeEventListener("keydown", press);
      window.removeEventListener("keyup", press);
      window.removeEventListener("blur", release);
    };
  }, [driving, hold, release]);
  if (ready?.scene.machine == null || live === null) return null;
  return (
    <Section
      title={driving ? "You drive" : "Where it ended"}
      aside={
        driving ? (
          <Button
            size="compact-sm"
            variant="default"
            leftSection={<IconPlayerStop size={14} aria-hidden />}
            onClick={drive.end}
          >
            End the drive
          </Button>
        ) : null
      }
    >
      <Stack gap="xs">
        <Suspense fallback={<Loading rows={10} />}>
          <DriveScene scene={ready.scene.machine} scenario={ready.scene.scenario} live={live} playing={driving} />
        </Suspense>
        <Dials live={live} duration={ready.duration_s} driving={driving} />
        <Pad keys={ready.keys} held={drive.held} hold={hold} disabled={!driving} />
        {drive.broke.length > 0 && (
          <Text size="sm" c="var(--mantine-color-error)" role="status">
            ✕ broke: {drive.broke.slice(-6).join(", ")}
            {drive.broke.length > 6 && ` and ${drive.broke.length - 6} before`}
          </Text>
        )}
      </Stack>
    </Section>
  );
}

const isTyping = (target: EventTarget | null): boolean =>
  target instanceof HTMLElement && target.closest("input, textarea, select, [contenteditable]") !== null;

function Dials({ live, duration, driving }: { live: Live; duration: number; driving: boolean }) {
  const [, tick] = useState(0);
  useEffect(() => {
    if (!driving) return;
    const timer = setInterval(() => {
      tick((count) => count + 1);
    }, TELL_EVERY_MS);
    return () => {
      clearInterval(timer);
    };
  }, [driving]);
  const { height, speed } = motionOf(live);
  return (
    <Text size="sm" className="figures">
      {live.time === 0 && driving
        ? "Time begins with the first key."
        : `${number(live.time, 1)} of ${number(duration, 0)} s · height ${number(height, 1)} units · ${number(speed, 1)} units/s`}
    </Text>
  );
}

const WHY: Record<string, string> = {
  time: "The time is over.",
  stopped: "You ended it.",
  lost: "The line broke.",
  blown_up: "The machine blew up: nothing more can be known of it.",
  too_long: "It took too long.",
  too_many_presses: "More keys were pressed than are stored.",
  failed: "The simulator failed.",
};

function Over({ ended }: { ended: Ended }) {
  return (
    <Section title="The drive is over">
      <Stack gap="sm">
        <Text size="sm">
          {WHY[ended.why] ?? words(ended.why)} {ended.detail} {ended.presses.length} key presses in{" "}
          {number(ended.time_s, 2)} s.{" "}
          {ended.job === null
            ? "It was practice, and is stored nowhere."
            : "The trial is simulated again from these keys, to the end of its time, and scored:"}
        </Text>
        {ended.job !== null && <Tried key={ended.job} id={ended.job} />}
      </Stack>
    </Section>
  );
}
