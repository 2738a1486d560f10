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
  const model = (label: string, place: 0 | 1) => (
    <Select
      label={label}
      data={[...new Set([...names, ...given.filter((name) => name !== "")])]}
      value={given[place] === "" ? null : (given[place] ?? null)}
      placeholder="choose"
      searchable
      w={{ base: "100%", sm: 250 }}
      onChange={(name) => {
        setGiven(place === 0 ? [name ?? "", second] : [first, name ?? ""]);
      }}
    />
  );
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        void navigate({ search: { models: `${first},${second}`, ...scope } });
      }}
    >
      <Group align="end">
        {model("First model", 0)}
        {model("Second model", 1)}
        <Select
          label="Track"
          data={(found?.tracks ?? []).map((track) => ({ value: track, label: trackLabel(track) }))}
          value={scope.track ?? found?.track ?? null}
          allowDeselect={false}
          w={{ base: "100%", sm: 300 }}
          onChange={(track) => {
            setScope({ ...scope, track: track ?? undefined });
          }}
        />
        {!isSite && (
          <Select
            label="Tasks"
            data={scopes.map(({ key, label }) => ({ value: key, label }))}
            value={scopeOf(scope).key}
            allowDeselect={false}
            w={180}
            onChange={(key) => {
              const categories = scopes.find((one) => one.key === key)?.categories ?? [];
              const category = categories.length === 0 ? undefined : [...categories];
              setScope({ ...scope, category, task: undefined });
            }}
          />
        )}
        <Button type="submit" variant="default" disabled={first === "" || second === "" || first === second}>
          Compare models
        </Button>
      </Group>
    </form>
  );
}
