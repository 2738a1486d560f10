import {
  Autocomplete,
  Button,
  MultiSelect,
  NumberInput,
  SimpleGrid,
  Stack,
  Switch,
  TagsInput,
  Text,
  TextInput,
  Title,
} from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useMutation, useQuery } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { useRef, useState } from "react";
import { client, taken, type Schema } from "../../api/client";
import { ApiError } from "../../api/problem";
import { models, simulators, tasks } from "../../api/queries";
import { counted, dollars } from "../../format";
import { Collapsible } from "../../parts/Collapsible";
import { has, useCaller } from "../../parts/permissions";
import { ProblemNote } from "../../parts/Problem";

type Spec = Schema<"SweepSpec">;
/** What the form fills in; the service has the defaults of the rest. */
type Asked = Pick<Spec, "tasks" | "models"> & Partial<Spec>;

const BEGIN: Asked = { tasks: ["support-1", "lift-1"], models: ["builtin/expert", "builtin/random"], samples: 4 };
const PAUSE_MS = 400;

/** A random name for a submission; the browser's own needs https. */
function freshKey(): string {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

const estimate = (spec: Asked) => ({
  queryKey: ["estimate", spec],
  retry: false,
  staleTime: 60_000,
  queryFn: () => taken(client.POST("/v1/sweeps/estimate", { body: spec as Spec })),
});

/** A sweep in three fields; its cost is shown before it is submitted. */
export default function NewSweepPage() {
  const [spec, setSpec] = useState(BEGIN);
  const [settled] = useDebouncedValue(spec, PAUSE_MS);
  const query = useQuery(estimate(settled));
  const set = (change: Partial<Asked>): void => {
    setSpec({ ...spec, ...change });
  };
  const refusals = query.error instanceof ApiError ? (query.error.problem?.errors ?? []) : [];
  const fault = (field: string): string | undefined => {
    const found = refusals.find((one) => one.field.startsWith(field));
    if (found === undefined) return undefined;
    return found.choices.length > 0 ? `${found.message}: choose from ${found.choices.join(", ")}` : found.message;
  };
  const known = {
    tasks: useQuery(tasks()).data ?? [],
    models: useQuery(models()).data ?? [],
    simulators: useQuery(simulators()).data ?? [],
  };
  return (
    <Stack gap="md" maw={760}>
      <Title order={1}>New sweep</Title>
      <TagsInput
        label="Models"
        data={known.models.map(({ name }) => name)}
        value={spec.models}
        error={fault("models")}
        onChange={(to) => set({ models: to })}
      />
      <MultiSelect
        label="Tasks"
        data={known.tasks.map(({ name }) => name)}
        value={spec.tasks}
        searchable
        error={fault("tasks")}
        onChange={(to) => set({ tasks: to })}
      />
      <Amount
        label="Runs per task"
        value={spec.samples}
        error={fault("samples")}
        onAmount={(samples) => set({ samples })}
      />
      <Collapsible title="More">
        <SimpleGrid cols={{ base: 1, sm: 2 }} mt="xs">
          <TextInput
            label="Name"
            value={spec.name ?? ""}
            placeholder="sweep"
            error={fault("name")}
            onChange={(event) => set({ name: event.currentTarget.value || undefined })}
          />
          <Autocomplete
            label="Simulator"
            data={known.simulators.map(({ name }) => name)}
            value={spec.simulator ?? ""}
            placeholder="pybullet"
            error={fault("simulator")}
            onChange={(to) => set({ simulator: to || undefined })}
          />
          <Amount
            label="Extra trials in changed worlds"
            value={spec.worlds}
            placeholder="4"
            error={fault("worlds")}
            onAmount={(worlds) => set({ worlds })}
          />
          <Amount
            label="Budget, dollars"
            value={spec.budget?.max_cost_usd}
            placeholder="no limit"
            error={fault("budget")}
            onAmount={(dollars) => set({ budget: dollars === undefined ? undefined : { max_cost_usd: dollars } })}
          />
          <Switch
            label="Give models the data sheets"
            checked={spec.data_sheets !== false}
            onChange={(event) => set({ data_sheets: event.currentTarget.checked })}
          />
          <Switch
            label="Show models an example construction"
            checked={spec.one_shot === true}
            onChange={(event) => set({ one_shot: event.currentTarget.checked })}
          />
        </SimpleGrid>
        <Text size="xs" className="dimmed" mt="xs">
          Workflows, prompts, seeds, decoding and limits are set in a file: <code>buildarena sweep run FILE</code>
        </Text>
      </Collapsible>
      {query.isError && <ProblemNote error={query.error} retry={() => void query.refetch()} />}
      {query.data !== undefined && <Estimate found={query.data} />}
      <Submit spec={spec} ready={settled === spec && query.data !== undefined && !query.isError} />
    </Stack>
  );
}

interface AmountProps {
  label: string;
  value: number | null | undefined;
  placeholder?: string;
  error: string | undefined;
  onAmount: (to: number | undefined) => void;
}

/** A number that may be left out. */
function Amount({ value, onAmount, ...others }: AmountProps) {
  return (
    <NumberInput
      {...others}
      value={value ?? ""}
      min={0}
      maw={360}
      onChange={(to) => onAmount(to === "" ? undefined : Number(to))}
    />
  );
}

function Estimate({ found }: { found: Schema<"SweepEstimate"> }) {
  const unpriced = found.models.filter(({ usage }) => usage.cost_usd === null).map(({ model }) => model);
  const { trials, min_detectable_effect_per_task, samples_for_10pp_effect } = found.power;
  return (
    <div role="status" aria-label="Estimate">
      <Text fw={650}>
        {counted(found.jobs, "run")}, about {dollars(found.cost_usd)}
        {unpriced.length > 0 && `; no price is known of ${unpriced.join(", ")}`}
      </Text>
      <Text size="sm" className="dimmed">
        {counted(trials, "run")} each{" "}
        {min_detectable_effect_per_task === null
          ? "can’t separate models on a task"
          : `show a difference of ${Math.round(100 * min_detectable_effect_per_task)} points on a task`}
        . For a 10-point difference over all: {counted(samples_for_10pp_effect, "run")}.
      </Text>
    </div>
  );
}

function Submit({ spec, ready }: { spec: Asked; ready: boolean }) {
  const navigate = useNavigate();
  const who = useCaller();
  // One sweep has one key, however often it is sent: a second click, or one after an answer was lost, adds none.
  const keys = useRef(new Map<string, string>());
  const sending = useMutation({
    mutationFn: () => {
      const content = JSON.stringify(spec);
      const key = keys.current.get(content) ?? freshKey();
      keys.current.set(content, key);
      const params = { header: { "Idempotency-Key": key } };
      return taken(client.POST("/v1/sweeps", { body: spec as Spec, params }));
    },
    onSuccess: ({ id }) => navigate({ to: "/sweeps/$id", params: { id } }),
  });
  if (who !== undefined && !has(who, "submit"))
    return <Text size="sm">This key may only read: submitting needs the scope submit.</Text>;
  return (
    <>
      {sending.isError && <ProblemNote error={sending.error} />}
      <Button
        style={{ alignSelf: "start" }}
        disabled={!ready}
        loading={sending.isPending}
        onClick={() => sending.mutate()}
      >
        Start the sweep
      </Button>
    </>
  );
}
