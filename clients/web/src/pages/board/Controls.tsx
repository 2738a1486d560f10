import { Chip, Group, MultiSelect, Select, Stack, Switch, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { tasks, type Board } from "../../api/queries";
import { isSite } from "../../api/site";
import { trackLabel } from "../../format";
import type { BoardSearch } from "../../api/board-search";

/** The switches of the board. Each is a word of the address, so that a view can be sent. */
export function Controls({ board, search }: { board: Board; search: BoardSearch }) {
  const navigate = useNavigate({ from: "/" });
  const known = useQuery(tasks());
  const set = (change: Partial<BoardSearch>): void => {
    void navigate({ search: (before) => ({ ...before, ...change }), replace: true, resetScroll: false });
  };
  const names = (known.data ?? []).map((task) => task.name);
  return (
    <Group align="end" gap="sm">
      <Select
        label="Track"
        data={board.tracks.map((track) => ({ value: track, label: trackLabel(track) }))}
        value={board.track}
        allowDeselect={false}
        w={{ base: "100%", sm: 340 }}
        onChange={(track) => {
          set({ track: track ?? undefined });
        }}
      />
      <MultiSelect
        label="Tasks"
        data={names}
        value={search.task ?? []}
        placeholder={(search.task ?? []).length > 0 ? "" : "all"}
        // A published site holds its boards as a whole and task by task.
        maxValues={isSite ? 1 : undefined}
        clearable
        clearButtonProps={{ "aria-label": "All tasks" }}
        searchable
        w={{ base: "100%", sm: 240 }}
        onChange={(task) => {
          set({ task: task.length > 0 ? task : undefined });
        }}
      />
      <Stack gap={3}>
        <Text size="sm" fw={500} id="reading">
          Flagged results
        </Text>
        <Chip.Group
          value={search.policy ?? "ours"}
          onChange={(policy) => {
            set({ policy: policy === "published" ? "published" : undefined });
          }}
        >
          <Group gap={6} role="radiogroup" aria-labelledby="reading">
            <Chip value="ours" size="sm" radius="sm">
              count as failures
            </Chip>
            <Chip value="published" size="sm" radius="sm">
              as the paper
            </Chip>
          </Group>
        </Chip.Group>
      </Stack>
      <Stack gap={6}>
        <Switch
          label="Baselines"
          checked={search.baselines !== "no"}
          onChange={(event) => {
            set({ baselines: event.currentTarget.checked ? undefined : "no" });
          }}
        />
        <Switch
          label="The paper’s figures"
          checked={search.paper === "yes"}
          onChange={(event) => {
            set({ paper: event.currentTarget.checked ? "yes" : undefined });
          }}
        />
      </Stack>
    </Group>
  );
}
