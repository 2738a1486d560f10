import { Button, Collapse, Group, Select, Stack, TextInput } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { useState } from "react";
import type { JobsSearch } from "../../api/jobs-search";
import { jobSummary, models, sweeps, tasks } from "../../api/queries";
import { words } from "../../format";

const LONGEST = 34;
const OUTCOMES = ["success", "unsuccessful", "construction_failed", "limit", "errored", "cancelled"];
const STATES = ["queued", "running", "on_hold", "done"];
/** What stands below "More filters". */
const FURTHER = ["text", "flag", "sweep"] as const;
/** What only links set: each can be taken away. */
const LINKED = ["category", "track", "task_version", "configuration"] as const;

type Change = Partial<JobsSearch>;

/** The filters of the list of jobs; each is a word of the address, so that a list can be sent. */
export function Filters({ search }: { search: JobsSearch }) {
  const navigate = useNavigate({ from: "/jobs" });
  const set = (change: Change): void => {
    void navigate({ search: (before) => ({ ...before, ...change }), replace: true, resetScroll: false });
  };
  const further = FURTHER.filter((name) => search[name] !== undefined).length;
  const [opened, more] = useDisclosure(further > 0);
  const known = { tasks: useQuery(tasks()), models: useQuery(models()) };
  const counted = useQuery(jobSummary({ ...search, reason: undefined, sort: undefined, order: undefined })).data;
  const reasons = [...new Set((counted?.endings ?? []).flatMap(({ reason }) => reason ?? []))];
  return (
    <Stack gap="xs">
      <Group align="end" gap="sm">
        <Choice name="task" label="Task" data={(known.tasks.data ?? []).map((one) => one.name)} {...{ search, set }} />
        <Choice
          name="model"
          label="Model"
          data={(known.models.data ?? []).map((one) => one.name)}
          {...{ search, set }}
        />
        <Choice name="state" label="State" data={STATES} {...{ search, set }} />
        <Choice name="outcome" label="Outcome" data={OUTCOMES} {...{ search, set }} />
        <Choice name="reason" label="Reason" data={reasons} {...{ search, set }} />
        <Button variant="subtle" aria-expanded={opened} onClick={more.toggle}>
          {opened ? "Fewer filters" : "More filters"}
          {further > 0 && !opened ? ` (${further})` : ""}
        </Button>
      </Group>
      <Collapse expanded={opened}>
        {opened && <Further {...{ search, set }} flags={Object.keys(counted?.flags ?? {})} />}
      </Collapse>
      <Group gap="xs">
        {LINKED.filter((name) => search[name] !== undefined && search[name] !== null).map((name) => (
          <Button
            key={name}
            variant="light"
            size="xs"
            onClick={() => {
              set({ [name]: undefined });
            }}
          >
            {words(name)}: {String(search[name]).slice(0, LONGEST)} ✕
          </Button>
        ))}
      </Group>
    </Stack>
  );
}

interface Set {
  search: JobsSearch;
  set: (change: Change) => void;
}

interface ChoiceOf extends Set {
  name: "task" | "model" | "state" | "outcome" | "reason" | "flag";
  label: string;
  data: readonly string[];
}

function Choice({ name, label, data, search, set }: ChoiceOf) {
  const chosen = search[name] ?? null;
  const values = [...new Set([...data, ...(chosen === null ? [] : [chosen])])];
  return (
    <Select
      label={label}
      data={values.map((value) => ({ value, label: words(value) }))}
      value={chosen}
      placeholder="all"
      clearable
      searchable
      clearButtonProps={{ "aria-label": `Every ${name}` }}
      w={170}
      onChange={(value) => {
        set({ [name]: value ?? undefined });
      }}
    />
  );
}

function Further({ search, set, flags }: Set & { flags: readonly string[] }) {
  const listed = useQuery(sweeps()).data?.data ?? [];
  const named = listed.map((sweep) => ({ value: sweep.id, label: `${sweep.name} (${sweep.id.slice(6, 12)})` }));
  const chosen = search.sweep ?? null;
  const known = chosen === null || listed.some((sweep) => sweep.id === chosen);
  return (
    <Group align="end" gap="sm">
      <Text search={search} set={set} />
      <Choice name="flag" label="Flag" data={flags} {...{ search, set }} />
      <Select
        label="Sweep"
        data={known ? named : [{ value: chosen, label: chosen }, ...named]}
        value={chosen}
        placeholder="all"
        clearable
        searchable
        clearButtonProps={{ "aria-label": "Every sweep" }}
        w={220}
        onChange={(value) => {
          set({ sweep: value ?? undefined });
        }}
      />
    </Group>
  );
}

function Text({ search, set }: Set) {
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
      onChange={(event) => {
        setText(event.currentTarget.value);
      }}
      onBlur={take}
      onKeyDown={(event) => {
        if (event.key === "Enter") take();
      }}
    />
  );
}
