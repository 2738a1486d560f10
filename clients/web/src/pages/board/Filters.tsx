import { Button, Chip, Group, MultiSelect, Popover, Select, Stack, Switch } from "@mantine/core";
import { useNavigate } from "@tanstack/react-router";
import type { BoardSearch } from "../../api/board-search";
import type { Board, Task } from "../../api/queries";
import { isSite } from "../../api/site";
import { trackLabel } from "../../format";
import { scopeOf, scopesOf } from "./scope";

interface Filtering {
  search: BoardSearch;
  tasks: readonly Task[];
  board: Board | undefined;
}

/** What of the results the page shows. Each choice is a word of the address, so that a view can be sent. */
export function Filters({ search, tasks, board }: Filtering) {
  const navigate = useNavigate({ from: "/" });
  const set = (change: Partial<BoardSearch>): void => {
    void navigate({ search: (before) => ({ ...before, ...change }), replace: true, resetScroll: false });
  };
  const scopes = scopesOf(tasks);
  const inPlace = { comboboxProps: { withinPortal: false } };
  return (
    <Group wrap="nowrap" gap="sm" justify="space-between">
      <Chip.Group
        value={scopeOf(search, scopes).key}
        onChange={(key) => set({ category: key === "" ? undefined : [key], task: undefined })}
      >
        <Group gap={6} wrap="nowrap" className="one-row" role="radiogroup" aria-label="Which tasks">
          {scopes.map(({ key, label }) => (
            <Chip key={key} value={key} size="xs">
              {label}
            </Chip>
          ))}
        </Group>
      </Chip.Group>
      <Popover position="bottom-end" withArrow trapFocus>
        <Popover.Target>
          <Button variant="default" size="xs" style={{ flexShrink: 0 }}>
            Filters
          </Button>
        </Popover.Target>
        <Popover.Dropdown>
          <Stack gap="sm" w={300}>
            <Select
              label="Protocol"
              data={(board?.tracks ?? []).map((track) => ({ value: track, label: trackLabel(track) }))}
              value={board?.track ?? null}
              allowDeselect={false}
              onChange={(track) => set({ track: track ?? undefined })}
              {...inPlace}
            />
            <MultiSelect
              label="Tasks"
              data={tasks.map((task) => task.name)}
              value={search.task ?? []}
              placeholder={(search.task ?? []).length > 0 ? "" : "all"}
              // A published site holds its boards as a whole and task by task.
              maxValues={isSite ? 1 : undefined}
              clearable
              clearButtonProps={{ "aria-label": "All tasks" }}
              searchable
              onChange={(task) => set({ task: task.length > 0 ? task : undefined })}
              {...inPlace}
            />
            <Switch
              label="Baselines"
              checked={search.baselines !== "no"}
              onChange={(event) => set({ baselines: event.currentTarget.checked ? undefined : "no" })}
            />
          </Stack>
        </Popover.Dropdown>
      </Popover>
    </Group>
  );
}
