import { Badge, Code, Group, Select, Stack, Switch, Text, TextInput } from "@mantine/core";
import { useVirtualizer } from "@tanstack/react-virtual";
import { memo, useMemo, useRef, useState } from "react";
import { count, dollars, duration, words } from "../../format";
import { callLine, chosenTurns, ROLE_COLOURS, type Turn, type TurnAction } from "./transcript";

const ESTIMATE_PX = 140;
const HEIGHT_PX = 760;

/** A session's turns, virtualised: only those in sight are drawn. */
export function TranscriptView({ turns }: { turns: readonly Turn[] }) {
  const [role, setRole] = useState<string | null>(null);
  const [refusedOnly, setRefusedOnly] = useState(false);
  const [text, setText] = useState("");
  const frame = useRef<HTMLDivElement>(null);
  const shown = useMemo(() => chosenTurns(turns, { role, refusedOnly, text }), [turns, role, refusedOnly, text]);
  const list = useVirtualizer({
    count: shown.length,
    getScrollElement: () => frame.current,
    estimateSize: () => ESTIMATE_PX,
    getItemKey: (index) => shown[index]?.index ?? index,
    overscan: 4,
    gap: 10,
  });
  const roles = [...new Set(turns.map((turn) => turn.role))];
  return (
    <Stack gap="xs">
      <Group gap="sm" align="end">
        <TextInput
          label="Find"
          placeholder="text, tool, feedback"
          value={text}
          w={200}
          onChange={(event) => {
            setText(event.currentTarget.value);
          }}
        />
        <Select label="Role" data={roles} value={role} onChange={setRole} placeholder="all" clearable clearButtonProps={{ "aria-label": "Every role" }} w={140} />
        <Switch
          mb={8}
          label="Refused actions only"
          checked={refusedOnly}
          onChange={(event) => {
            setRefusedOnly(event.currentTarget.checked);
          }}
        />
      </Group>
      <Text size="xs" className="dimmed" role="status">
        {shown.length === turns.length ? `${turns.length} turns` : `${shown.length} of ${turns.length} turns`}
      </Text>
      <div ref={frame} style={{ height: Math.min(HEIGHT_PX, Math.max(160, list.getTotalSize())), overflow: "auto" }} tabIndex={0} role="region" aria-label="Transcript, scrolls">
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
                {turn !== undefined && <TurnCard turn={turn} />}
              </div>
            );
          })}
        </div>
      </div>
    </Stack>
  );
}

const TurnCard = memo(function TurnCard({ turn }: { turn: Turn }) {
  const colour = ROLE_COLOURS[turn.role] ?? "gray";
  return (
    <article className="turn" style={{ "--turn-colour": `var(--mantine-color-${colour}-6)` } as React.CSSProperties} aria-label={`Turn ${turn.index}, ${turn.role}`}>
      <Group justify="space-between" gap="xs" mb={4}>
        <Group gap={6}>
          <Text size="xs" className="figures dimmed">
            {turn.index}
          </Text>
          <Text size="sm" fw={650}>
            {turn.role}
          </Text>
          <Text size="xs" className="dimmed">
            {turn.stage}
            {turn.sub_structure === null ? "" : ` · ${turn.sub_structure}`}
          </Text>
          {turn.finish !== undefined && turn.finish !== "stop" && turn.finish !== "tool_calls" && (
            <Badge size="xs" color="yellow" variant="outline" tt="none" styles={{ root: { color: "inherit" } }}>
              {turn.finish}
            </Badge>
          )}
        </Group>
        {turn.input_tokens !== undefined && (
          <Text size="xs" className="figures dimmed">
            {count(turn.input_tokens)} in · {count(turn.output_tokens)} out · {dollars(Number(turn.cost_usd ?? 0))} · {duration(turn.latency_s)}
          </Text>
        )}
      </Group>
      {turn.text !== "" && <div className="turn-text">{turn.text}</div>}
      {turn.actions.map((action, index) => (
        <ActionFold key={index} action={action} />
      ))}
    </article>
  );
});

function ActionFold({ action }: { action: TurnAction }) {
  return (
    <details style={{ marginTop: 6 }} open={!action.ok}>
      <summary style={{ cursor: "pointer" }}>
        <Badge size="sm" mr={6} variant="outline" color={action.ok ? "teal" : "red"} tt="none" styles={{ root: { color: "inherit" } }}>
          {action.ok ? "✓ accepted" : `✗ ${words(action.reason ?? "refused")}`}
        </Badge>
        <Code style={{ overflowWrap: "anywhere" }}>{callLine(action)}</Code>
      </summary>
      <pre className="feedback" style={{ padding: "6px 10px" }}>
        {action.feedback}
      </pre>
    </details>
  );
}
