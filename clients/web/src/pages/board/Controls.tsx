import { Group, MultiSelect, Select, Switch } from "@mantine/core";
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
      <Switch
        label="Baselines"
        checked={search.baselines !== "no"}
        mb={6}
        onChange={(event) => {
          set({ baselines: event.currentTarget.checked ? undefined : "no" });
        }}
      />
    </Group>
  );
}
