import { ActionIcon, Alert, Anchor, Code, Group, Select, Slider, Stack, Text } from "@mantine/core";
import {
  IconChevronLeft,
  IconChevronRight,
  IconPlayerPause,
  IconPlayerPlay,
  IconPlayerSkipBack,
  IconPlayerSkipForward,
} from "@tabler/icons-react";
import { lazy, Suspense, useEffect, useState, type KeyboardEvent } from "react";
import { counted, words } from "../../format";
import { Loading } from "../../parts/States";
import type { Build } from "./build";
import { chapterTitle, rangeOf } from "./replay";
import { callLine } from "./transcript";

const BuildScene = lazy(() => import("../../scene/BuildScene"));
const STEP_MS = 450;

/** The machine after a step, with what leads from step to step: buttons, slider, arrow keys, play. */
export function BuildPart({ build }: { build: Build }) {
  const { step, at, steps } = build;
  const chapter = build.replay?.chapters[step?.chapter ?? 0];
  const onKeys = (event: KeyboardEvent): void => {
    if (event.target instanceof HTMLInputElement || (event.target as HTMLElement).role === "slider") return;
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    build.go(at + by);
  };
  return (
    <Stack gap="xs" onKeyDown={onKeys} data-step={at} data-steps={steps.length}>
      <Suspense fallback={<Loading rows={10} />}>
        <BuildScene
          parts={build.parts}
          whole={build.whole}
          ghosts={build.ghosts}
          chosen={build.marked}
          onChoose={(id) => build.choose(id === build.part ? undefined : id)}
          subject={chapter?.name ?? ""}
          label={`The machine after step ${at + 1} of ${steps.length}: ${counted(build.parts.size, "part")}`}
        />
      </Suspense>
      <Buttons build={build} />
      <Chapters build={build} />
      <StepResult build={build} />
      <ChosenPart build={build} />
      {build.replay?.complete === false && (
        <Text size="xs">The session has too many steps to show: the last are left out.</Text>
      )}
      {build.replay?.exact === false && (
        <Text size="xs">
          Done again by this version of the geometry library, the steps do not end in exactly the kept machine.
        </Text>
      )}
    </Stack>
  );
}

function Buttons({ build }: { build: Build }) {
  const { at, steps, go } = build;
  const last = steps.length - 1;
  const [playing, setPlaying] = useState(false);
  useEffect(() => {
    if (!playing) return;
    const timer = setTimeout(() => {
      if (at < last) go(at + 1);
      else setPlaying(false);
    }, STEP_MS);
    return () => {
      clearTimeout(timer);
    };
  }, [playing, at, last, go]);
  const button = (label: string, icon: React.ReactNode, to: number) => (
    <ActionIcon
      variant="default"
      size="lg"
      aria-label={label}
      disabled={to < 0 || to > last || to === at}
      onClick={() => {
        setPlaying(false);
        go(to);
      }}
    >
      {icon}
    </ActionIcon>
  );
  return (
    <Group wrap="nowrap" gap={6}>
      {button("First step", <IconPlayerSkipBack size={18} aria-hidden />, 0)}
      {button("One step back", <IconChevronLeft size={18} aria-hidden />, at - 1)}
      <ActionIcon
        size="lg"
        aria-label={playing ? "Stop building" : "Build it step by step"}
        onClick={() => {
          if (!playing && at >= last) go(0);
          setPlaying(!playing);
        }}
      >
        {playing ? <IconPlayerPause size={18} aria-hidden /> : <IconPlayerPlay size={18} aria-hidden />}
      </ActionIcon>
      {button("One step on", <IconChevronRight size={18} aria-hidden />, at + 1)}
      {button("Last step", <IconPlayerSkipForward size={18} aria-hidden />, last)}
      <Slider
        style={{ flex: 1, minWidth: 40 }}
        min={0}
        max={Math.max(0, last)}
        value={at}
        onChange={(to) => {
          setPlaying(false);
          go(to);
        }}
        label={(value) => `step ${value + 1}`}
        thumbLabel="Step of the build"
      />
      <Text size="sm" className="figures" style={{ whiteSpace: "nowrap" }}>
        {at + 1} / {steps.length}
      </Text>
    </Group>
  );
}

function Chapters({ build }: { build: Build }) {
  const chapters = build.replay?.chapters ?? [];
  if (chapters.length < 2) return null;
  const data = chapters.flatMap((chapter, index) => {
    const range = rangeOf(build.steps, index);
    return range === null
      ? []
      : [{ value: String(index), label: `${chapterTitle(chapter)} (steps ${range[0] + 1} to ${range[1] + 1})` }];
  });
  return (
    <Select
      label="Chapter"
      size="xs"
      data={data}
      value={String(build.step?.chapter ?? 0)}
      allowDeselect={false}
      onChange={(value) => {
        const range = rangeOf(build.steps, Number(value));
        if (range !== null) build.go(range[1]);
      }}
    />
  );
}

/** What the step is, and its result. */
function StepResult({ build }: { build: Build }) {
  const { step } = build;
  if (step === undefined) return null;
  const call = callLine({ name: step.action, arguments: step.arguments });
  if (step.accepted) {
    const changes = [
      [step.added.length, "added"],
      [step.moved.length, "moved"],
      [step.removed.length, "removed"],
      [step.rebound.length, "given keys or a sense of rotation"],
    ].flatMap(([count, what]) => (count === 0 ? [] : [`${count} ${what}`]));
    return (
      <div role="status">
        <Code style={{ overflowWrap: "anywhere" }}>{call}</Code>
        <Text size="sm" className="dimmed">
          ✓ accepted{changes.length > 0 ? `: ${changes.join(", ")}` : ""}
          {step.turn === null ? "; the session did it by itself" : `; turn ${step.turn}`}
        </Text>
      </div>
    );
  }
  return (
    <Alert color="red" py="xs" role="status" title={`✗ refused: ${words(step.reason ?? "refused")}`}>
      <Code style={{ overflowWrap: "anywhere" }}>{call}</Code>
      <Text size="sm" style={{ whiteSpace: "pre-wrap", overflowWrap: "anywhere" }}>
        {step.text}
      </Text>
      <Text size="xs">
        {step.attempted.length > 0
          ? "The see-through block with drawn edges is where it would have been."
          : "Where it would have been is not known."}
      </Text>
    </Alert>
  );
}

function ChosenPart({ build }: { build: Build }) {
  const part = build.part === undefined ? undefined : build.parts.get(build.part);
  if (part === undefined)
    return (
      <Text size="xs" className="dimmed">
        Drag to turn, scroll to come closer, click a part to see what made it. Arrow keys step.
      </Text>
    );
  const bindings = Object.entries(part.bindings).filter(([, keys]) => keys.length > 0);
  const { madeBy } = build;
  return (
    <Alert
      color="pink"
      py="xs"
      title={`${part.id}: ${part.module}`}
      withCloseButton
      closeButtonLabel="Choose no part"
      onClose={() => build.choose(undefined)}
    >
      <Text size="sm">
        Its root is at ({part.position.map((value) => value.toFixed(2)).join(", ")}).
        {part.flipped ? " Its spin is flipped." : ""}
        {bindings.map(([action, keys]) => ` ${action}: ${keys.join(", ")}.`).join("")}{" "}
        {madeBy !== undefined && (
          <Anchor component="button" type="button" inherit onClick={() => build.go(madeBy)}>
            Step {madeBy + 1} made it.
          </Anchor>
        )}
      </Text>
    </Alert>
  );
}
