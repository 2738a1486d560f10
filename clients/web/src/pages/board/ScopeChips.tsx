import { Chip, Group } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { tasks } from "../../api/queries";
import type { BoardSearch } from "../../api/board-search";
import { scopeOf, scopesOf } from "./scope";

/** What the whole page is about: ranking, figures and plots. */
export function ScopeChips({ search }: { search: BoardSearch }) {
  const navigate = useNavigate({ from: "/" });
  const known = useQuery(tasks());
  const scopes = scopesOf(known.data ?? []);
  return (
    <Chip.Group
      value={scopeOf(search).key}
      onChange={(key) => {
        const chosen = scopes.find((scope) => scope.key === key);
        const category = chosen === undefined || chosen.categories.length === 0 ? undefined : [...chosen.categories];
        void navigate({
          search: (before) => ({ ...before, category, task: undefined }),
          replace: true,
          resetScroll: false,
        });
      }}
    >
      <Group gap={6} role="radiogroup" aria-label="Which tasks">
        {scopes.map((scope) => (
          <Chip key={scope.key} value={scope.key} size="xs" radius="sm">
            {scope.label}
          </Chip>
        ))}
      </Group>
    </Chip.Group>
  );
}
