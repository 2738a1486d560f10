import { Group, Select, Stack, Switch, Text, TextInput } from "@mantine/core";
import { useVirtualizer } from "@tanstack/react-virtual";
import { memo, useEffect, useMemo, useRef, useState } from "react";
import { count, dollars, duration, words } from "../../format";
import type { Build } from "./build";
import { callLine, chosenTurns, messagesOf, type Prompt, ROLE_COLOURS, type Turn, type TurnAction } from "./transcript";

const ESTIMATE_PX = 140;
const HEIGHT_PX = 760;

/** A session's turns, virtualised: only those in sight are drawn. */
export function TranscriptView({
  turns,
  prompts,
  build,
  chosen,
}: {
  turns: readonly Turn[];
  /** The messages of each role; there are none for agents and former releases. */
  prompts?: readonly Prompt[] | null | undefined;
  build: Build;
  /** The turn that the address names: shown first, and marked. */
  chosen?: number | undefined;
}) {
  const [role, setRole] = useState<string | null>(null);
  const [refusedOnly, setRefusedOnly] = useState(false);
  const [text, setText] = useState("");
  const frame = useRef<HTMLDivElement>(null);
  const shown = useMemo(() => chosenTurns(turns, { role, refusedOnly, text }), [turns, role, refusedOnly, text]);
  const promptOf = useMemo(() => new Map((prompts ?? []).map((prompt) => [prompt.turn, prompt])), [prompts]);
  const list = useVirtualizer({
    count: shown.length,
    getScrollElement: () => frame.current,
    estimateSize: () => ESTIMATE_PX,
    getItemKey: (index) => shown[index]?.index ?? index,
    overscan: 4,
    gap: 10,
  });
  useInStep(build, shown, frame, (place) => {
    list.scrollToIndex(place, { align: "center" });
  });
  const place = chosen === undefined ? -1 : shown.findIndex((turn) => turn.index === chosen);
  useEffect(() => {
    if (place >= 0) list.scrollToIndex(place, { align: "start" });
    // eslint-disable-next-line react-hooks/exhaustive-deps -- only what the address says scrolls
  }, [place]);
  const roles = [...new Set(turns.map((turn) => turn.role))];
  const latest = useRef(build.go);
  useEffect(() => {
    latest.current = build.go;
  });
  const go = useMemo(
    () => (step: number) => {
      latest.current(step);
    },
    [],
  );
  return (
    <Stack gap="xs">
      <Group gap="sm" align="end">
        <TextInput
          label="Find"
          placeholder="text, tool, feedback"
          value={text}
          w={200}
          onChange={(event) => setText(event.currentTarget.value)}
        />
        <Select
          label="Role"
          data={roles}
          value={role}
          onChange={setRole}
          placeholder="all"
          clearable
          clearButtonProps={{ "aria-label": "Every role" }}
          w={140}
        />
        <Switch
          mb={8}
          label="Refused actions only"
          checked={refusedOnly}
          onChange={(event) => setRefusedOnly(event.currentTarget.checked)}
        />
      </Group>
      <Text size="xs" className="dimmed" role="status">
        {shown.length === turns.length ? `${turns.length} turns` : `${shown.length} of ${turns.length} turns`}
      </Text>
      <div
        ref={frame}
        style={{ height: Math.min(HEIGHT_PX, Math.max(160, list.getTotalSize())), overflow: "auto" }}
        tabIndex={0}
        role="region"
        aria-label="Transcript, scrolls"
      >
        <div style={{ height: list.getTotalSize(), position: "relative" }}>
          {list.getVirtualItems().map((item) => {
            const turn = shown[item.index];
            return (
              <div
                key={item.key}
                ref={list.measureElement}
                data-index={item.index}
                style={{ position: "absolute", top: 0, left: 0, right: 0, transform: `translateY(${item.start}px)` }}
              >
                {turn !== undefined && (
                  <TurnCard
                    turn={turn}
                    prompt={promptOf.get(turn.index)}
                    marked={markedIn(build.markedAction, turn.index) ?? (turn.index === chosen ? -1 : null)}
                    stepOf={build.stepOf}
                    go={go}
                  />
                )}
              </div>
            );
          })}
        </div>
      </div>
    </Stack>
  );
}

/** The action of this turn that is marked: its place; -1 for the turn alone; null for none. */
function markedIn(marked: string | null, turn: number): number | null {
  const [of, place] = (marked ?? "").split(":");
  if (of === "" || Number(of) !== turn) return null;
  return place === "" || place === undefined ? -1 : Number(place);
}

const NEAR_PX = 200;

/** Brings the turn of the step into sight; a live one only for a reader at the end. */
function useInStep(
  build: Build,
  shown: readonly Turn[],
  frame: React.RefObject<HTMLDivElement | null>,
  show: (place: number) => void,
): void {
  const { markedAction, following } = build;
  const begun = useRef(false);
  useEffect(() => {
    const first = !begun.current;
    begun.current = true;
    const box = frame.current;
    if (box === null || markedAction === null) return;
    if (following && build.part === undefined) {
      const nearEnd = box.scrollHeight - box.scrollTop - box.clientHeight < NEAR_PX;
      if (first || !nearEnd) return;
    }
    const place = shown.findIndex((turn) => markedIn(markedAction, turn.index) !== null);
    if (place >= 0) show(place);
    // eslint-disable-next-line react-hooks/exhaustive-deps -- filters and folds shall not scroll
  }, [markedAction, following]);
}

interface TurnProps {
  turn: Turn;
  prompt: Prompt | undefined;
  marked: number | null;
  stepOf: ReadonlyMap<string, number>;
  go: (step: number) => void;
}

const TurnCard = memo(function TurnCard({ turn, prompt, marked, stepOf, go }: TurnProps) {
  const colour = ROLE_COLOURS[turn.role] ?? "gray";
  return (
    <article
      className="turn"
      style={{ "--turn-colour": `var(--mantine-color-${colour}-6)` } as React.CSSProperties}
      aria-label={`Turn ${turn.index}, ${turn.role}`}
      data-turn={turn.index}
      data-chosen={marked === null ? undefined : true}
    >
      <header className="turn-head">
        <span className="figures dimmed">{turn.index}</span>
        <b>{turn.role}</b>
        <span className="dimmed">
          {turn.stage}
          {turn.sub_structure === null ? "" : ` · ${turn.sub_structure}`}
        </span>
        {turn.finish !== undefined && turn.finish !== "stop" && turn.finish !== "tool_calls" && (
          <span className="tag">{turn.finish}</span>
        )}
        {turn.input_tokens !== undefined && (
          <span className="figures dimmed turn-usage">
            {count(turn.input_tokens)} in · {count(turn.output_tokens)} out · {dollars(Number(turn.cost_usd ?? 0))} ·{" "}
            {duration(turn.latency_s)}
          </span>
        )}
      </header>
      {prompt !== undefined && <RolePrompt prompt={prompt} role={turn.role} />}
      {turn.text !== "" && <div className="turn-text">{turn.text}</div>}
      {turn.actions.map((action, index) => (
        <ActionFold
          key={index}
          action={action}
          chosen={marked === index}
          step={stepOf.get(`${turn.index}:${index}`)}
          go={go}
        />
      ))}
    </article>
  );
});

/** What the session sent the role before it spoke: folded, as it is long and mostly known. */
function RolePrompt({ prompt, role }: { prompt: Prompt; role: string }) {
  const messages = messagesOf(prompt);
  const characters = messages.reduce((sum, { text }) => sum + text.length, 0);
  return (
    <details className="prompt">
      <summary style={{ cursor: "pointer" }}>
        What the {role} was given{" "}
        <span className="dimmed figures">
          {prompt.system === null ? "" : "system message and "}
          {count(prompt.user.length)} {prompt.user.length === 1 ? "message" : "messages"}, {count(characters)}{" "}
          characters
        </span>
      </summary>
      {messages.map(({ kind, text }, index) => (
        <div key={index}>
          <span className="tag">{kind}</span>
          <pre className="feedback prompt-text" tabIndex={0} role="region" aria-label={`${kind} message, scrolls`}>
            {text}
          </pre>
        </div>
      ))}
    </details>
  );
}

function ActionFold({
  action,
  chosen,
  step,
  go,
}: {
  action: TurnAction;
  chosen: boolean;
  step: number | undefined;
  go: (step: number) => void;
}) {
  return (
    <div
      className="action-line"
      data-chosen={chosen ? true : undefined}
      aria-current={chosen ? "step" : undefined}
      style={{ marginTop: 6, display: "flex", gap: 8, alignItems: "start" }}
    >
      <details style={{ flex: 1, minWidth: 0 }} open={!action.ok}>
        <summary style={{ cursor: "pointer" }}>
          <span className={action.ok ? "tag tag-good" : "tag tag-bad"}>
            {action.ok ? "✓ accepted" : `✗ ${words(action.reason ?? "refused")}`}
          </span>
          <code className="call">{callLine(action)}</code>
        </summary>
        <pre className="feedback" style={{ padding: "6px 10px" }}>
          {action.feedback}
        </pre>
      </details>
      {step !== undefined && (
        <button type="button" className="step-link" onClick={() => go(step)}>
          step {step + 1}
        </button>
      )}
    </div>
  );
}
