import { Button, Group, Select, TextInput } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import type { JobsSearch } from "../../api/jobs-search";
import { jobSummary, models, tasks } from "../../api/queries";
import { stateWords, titled, words } from "../../format";

const LONGEST = 34;
const OUTCOMES = ["success", "unsuccessful", "construction_failed", "limit", "excluded", "errored", "cancelled"];
/** What only links set: each can be taken away. */
const LINKED = ["category", "sweep", "state", "flag", "track", "task_version", "configuration"] as const;

interface Filtering {
  search: JobsSearch;
  set: (change: Partial<JobsSearch>) => void;
}

/** The filters of the list of jobs; each is a word of the address, so that a list can be sent. */
export function Filters({ search, set }: Filtering) {
  const known = { tasks: useQuery(tasks()).data ?? [], models: useQuery(models()).data ?? [] };
  const summary = useQuery(jobSummary({ ...search, reason: undefined, sort: undefined, order: undefined })).data;
  const choice = (name: "task" | "model" | "outcome" | "reason", data: readonly string[]) => {
    const chosen = search[name] ?? null;
    return (
      <Select
        key={name}
        label={titled(name)}
        data={[...new Set([...data, ...(chosen === null ? [] : [chosen])])].map((value) => ({
          value,
          label: name === "outcome" ? stateWords(value) : words(value),
        }))}
        value={chosen}
        placeholder="all"
        clearable
        searchable
        clearButtonProps={{ "aria-label": `Every ${name}` }}
        w={190}
        onChange={(value) => set({ [name]: value ?? undefined })}
      />
    );
  };
  return (
    <Group align="end" gap="sm">
      {choice(
        "task",
        known.tasks.map((one) => one.name),
      )}
      {choice(
        "model",
        known.models.map((one) => one.name),
      )}
      {choice("outcome", OUTCOMES)}
      {choice(
        "reason",
        (summary?.endings ?? []).flatMap(({ reason }) => reason ?? []),
      )}
      <Contains search={search} set={set} />
      {LINKED.filter((name) => search[name] != null).map((name) => (
        <Button key={name} variant="light" onClick={() => set({ [name]: undefined })}>
          {words(name)}: {String(search[name]).slice(0, LONGEST)} ✕
        </Button>
      ))}
    </Group>
  );
}

function Contains({ search, set }: Filtering) {
  const [text, setText] = useState(search.text ?? "");
  const take = (): void => {
    if (text !== (search.text ?? "")) set({ text: text === "" ? undefined : text });
  };
  return (
    <TextInput
      label="Contains"
      placeholder="id, reason, detail"
      value={text}
      maxLength={100}
      w={170}
      onChange={(event) => setText(event.currentTarget.value)}
      onBlur={take}
      onKeyDown={(event) => {
        if (event.key === "Enter") take();
      }}
    />
  );
}
