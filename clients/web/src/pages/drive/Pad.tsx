import { Group, Text, UnstyledButton } from "@mantine/core";
import { words } from "../../format";
import { signOf } from "./keys";

interface PadProps {
  /** By key, what it does. */
  keys: Record<string, string[]>;
  held: ReadonlySet<string>;
  hold: (key: string, down: boolean) => void;
  disabled: boolean;
}

/** The machine's keys, to be held with a finger, and what each does. */
export function Pad({ keys, held, hold, disabled }: PadProps) {
  const names = Object.keys(keys);
  if (names.length === 0) return <Text size="sm">No key of this machine does anything here: it moves by itself.</Text>;
  return (
    <Group gap="xs" role="group" aria-label="Keys">
      {names.map((name) => (
        <UnstyledButton
          key={name}
          className="drive-key"
          disabled={disabled}
          aria-pressed={held.has(name)}
          data-held={held.has(name)}
          onPointerDown={(event) => {
            event.currentTarget.setPointerCapture(event.pointerId);
            hold(name, true);
          }}
          onPointerUp={() => {
            hold(name, false);
          }}
          onPointerCancel={() => {
            hold(name, false);
          }}
          onContextMenu={(event) => {
            event.preventDefault();
          }}
          onKeyDown={(event) => {
            if (event.key === " " || event.key === "Enter") hold(name, true);
          }}
          onKeyUp={(event) => {
            if (event.key === " " || event.key === "Enter") hold(name, false);
          }}
          onBlur={() => {
            hold(name, false);
          }}
        >
          <b>{signOf(name)}</b>
          <span>{doing(keys[name] ?? [])}</span>
        </UnstyledButton>
      ))}
    </Group>
  );
}

/** "spinning forward of 7, 9": of many parts only how many there are. */
function doing(actions: readonly string[]): string {
  return actions
    .map((one) => {
      const [action = "", parts = ""] = one.split(" of ");
      const count = parts.split(", ").length;
      return `${words(action)} ${count > 3 ? `of ${count} parts` : `of ${parts}`}`;
    })
    .join(", ");
}
