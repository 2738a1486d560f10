import { Button, Group, Stack, Text } from "@mantine/core";
import { IconRefresh, IconTrash } from "@tabler/icons-react";
import { number } from "../../format";
import type { Hand, SessionView } from "./session";
import { ToolForm } from "./ToolForm";

const QUARTER_DEG = 90;

/** What can be done with the chosen part. */
export function PartPanel({ hand, view }: { hand: Hand; view: SessionView }) {
  const { part } = hand;
  if (part === undefined) return <Text size="sm">Choose a part: in the list, or by a click on it.</Text>;
  const block = part.faces.length > 0 || part.start === null;
  const call =
    (tool: string, more: Record<string, unknown> = {}) =>
    () => {
      hand.act({ tool, arguments: { block_id: part.id, ...more } });
    };
  return (
    <Stack gap="sm">
      <div>
        <Text size="sm" fw={600}>
          {part.id}: {part.module}
        </Text>
        <Text size="xs" className="dimmed">
          Its root is at [{part.position.map((value) => number(value, 2)).join(", ")}].
          {part.flipped ? " Its spin is flipped." : ""}
        </Text>
      </div>
      <Group gap="xs">
        <Button
          size="xs"
          color="red"
          variant="light"
          leftSection={<IconTrash size={14} aria-hidden />}
          disabled={hand.busy}
          onClick={call("remove_block")}
        >
          Remove it
        </Button>
        {block && (
          <Button
            size="xs"
            variant="default"
            leftSection={<IconRefresh size={14} aria-hidden />}
            disabled={hand.busy}
            onClick={call("twist_block", { angle: QUARTER_DEG })}
          >
            Twist by 90°
          </Button>
        )}
        {part.spins && (
          <Button size="xs" variant="default" disabled={hand.busy} onClick={call("flip_spin")}>
            Flip its spin
          </Button>
        )}
        <Button size="xs" variant="default" disabled={hand.busy} onClick={call("get_block_details")}>
          Details
        </Button>
      </Group>
      {block && (
        <>
          <ToolForm
            key={`twist ${part.id}`}
            tool={view.tools.find((one) => one.name === "twist_block")}
            hand={hand}
            view={view}
          />
          <ToolForm
            key={`shift ${part.id}`}
            tool={view.tools.find((one) => one.name === "shift_block")}
            hand={hand}
            view={view}
          />
        </>
      )}
    </Stack>
  );
}
