import { Button, Group, Select } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { useState } from "react";
import { board, tasks as tasksQuery } from "../../api/queries";
import { isSite } from "../../api/site";
import { trackLabel } from "../../format";
import { namesOf } from "../board/entries";
import { scopeOf, scopesOf } from "../board/scope";
import { scoped, type CompareSearch, type Scoped } from "./search";

/** Chooses two models of a board, its track and its tasks. */
export function ModelPickers({ search }: { search: CompareSearch }) {
  const navigate = useNavigate({ from: "/compare" });
  const [scope, setScope] = useState<Scoped>(scoped(search));
  const [given, setGiven] = useState((search.models ?? "").split(",").map((name) => name.trim()));
  const found = useQuery(board(scope)).data;
  const scopes = scopesOf(useQuery(tasksQuery()).data ?? []);
  const names = found === undefined ? [] : [...namesOf(found).values()];
  const [first = "", second = ""] = given;
  const select = (
    label: string,
    data: readonly { value: string; label: string }[],
    value: string | null,
    onChange: (to: string) => void,
  ) => (
    <Select
      label={label}
      data={[...data]}
      value={value}
      placeholder="choose"
      searchable
      allowDeselect={false}
      w={{ base: "100%", sm: 250 }}
      onChange={(to) => onChange(to ?? "")}
    />
  );
  const models = [...new Set([...names, ...given.filter((name) => name !== "")])].map((value) => ({
    value,
    label: value,
  }));
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        void navigate({ search: { models: `${first},${second}`, ...scope } });
      }}
    >
      <Group align="end">
        {select("First model", models, first || null, (to) => {
          setGiven([to, second]);
        })}
        {select("Second model", models, second || null, (to) => {
          setGiven([first, to]);
        })}
        {select(
          "Protocol",
          (found?.tracks ?? []).map((track) => ({ value: track, label: trackLabel(track) })),
          scope.track ?? found?.track ?? null,
          (track) => {
            setScope({ ...scope, track });
          },
        )}
        {!isSite &&
          select(
            "Tasks",
            scopes.map(({ key, label }) => ({ value: key, label })),
            scopeOf(scope, scopes).key,
            (key) => {
              setScope({ ...scope, category: key === "" ? undefined : [key], task: undefined });
            },
          )}
        <Button type="submit" variant="default" disabled={first === "" || second === "" || first === second}>
          Compare models
        </Button>
      </Group>
    </form>
  );
}
