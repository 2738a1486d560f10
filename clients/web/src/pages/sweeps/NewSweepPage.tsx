import { Alert, Button, Group, SegmentedControl, Stack, Table, Text, Title } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { lazy, Suspense, useMemo, useRef, useState } from "react";
import { client, taken, type Schema } from "../../api/client";
import { ApiError } from "../../api/problem";
import { models, simulators, tasks } from "../../api/queries";
import { isSite } from "../../api/site";
import { compact, count, dollars } from "../../format";
import { has, useCaller } from "../../parts/may";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Empty, Loading } from "../../parts/States";
import type { Known } from "./spec/completion";
import { Form } from "./spec/Form";
import { faultsOf, readSpec, type Fault, type SweepSpec } from "./spec/spec";

const Editor = lazy(() => import("./spec/Editor"));

const BEGIN = `name: my first sweep
tasks: [support-1, lift-1]
models: [builtin/expert, builtin/random]
samples: 4
simulator: mujoco
`;
const PAUSE_MS = 400;

/** A random name for a submission; the browser's own needs https. */
function freshKey(): string {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

function estimate(spec: Record<string, unknown> | null) {
  return {
    queryKey: ["estimate", spec],
    enabled: spec !== null,
    retry: false,
    staleTime: 60_000,
    queryFn: () => taken(client.POST("/v1/sweeps/estimate", { body: spec as unknown as SweepSpec })),
  };
}

function useKnown(): Known {
  const knownTasks = useQuery(tasks()).data;
  const knownSimulators = useQuery(simulators()).data;
  const knownModels = useQuery(models()).data;
  return useMemo(
    () => ({
      tasks: (knownTasks ?? []).map((one) => one.name),
      models: (knownModels ?? []).map((one) => one.name),
      simulator: (knownSimulators ?? []).map((one) => one.name),
      ...{
        "workflow default": ["five-role"],
        "simulator default": (knownSimulators ?? []).filter((one) => one.default).map((one) => one.name),
        "prompts default": ["default"],
      },
    }),
    [knownTasks, knownModels, knownSimulators],
  );
}

/** A sweep from a form or as YAML; what it would take is told before it is submitted. */
export default function NewSweepPage() {
  return isSite ? (
    <Empty title="Sweeps are submitted to a running service">This is a published copy of its results.</Empty>
  ) : (
    <Writing />
  );
}

function Writing() {
  const [text, setText] = useState(BEGIN);
  const [way, setWay] = useState("form");
  const known = useKnown();
  const read = useMemo(() => readSpec(text), [text]);
  const [settled] = useDebouncedValue(text, PAUSE_MS);
  const asked = useMemo(() => readSpec(settled), [settled]);
  const query = useQuery(estimate(asked.value));
  const refusal = asked.value !== null && query.error instanceof ApiError ? query.error.problem : null;
  // Places are those of the text that was asked about.
  const refused = useMemo(
    () => (refusal === null || settled !== text ? [] : faultsOf(refusal, asked)),
    [refusal, asked, settled, text],
  );
  const faults: readonly Fault[] = read.value === null ? read.faults : refused;
  const ready = settled === text && query.data !== undefined && faults.length === 0;
  const editing = { text, onText: setText, faults, known };
  return (
    <Stack gap="lg">
      <Group justify="space-between">
        <Title order={1}>New sweep</Title>
        <SegmentedControl
          aria-label="How to write it"
          data={[
            { value: "form", label: "Form" },
            { value: "yaml", label: "YAML" },
          ]}
          value={way}
          onChange={setWay}
        />
      </Group>
      <Group align="start" gap="lg">
        <Stack style={{ flex: "2 1 420px", minWidth: 0 }}>
          {way === "yaml" && (
            <Suspense fallback={<Loading rows={8} />}>
              <Editor {...editing} />
            </Suspense>
          )}
          {way === "form" &&
            (read.value === null ? (
              <Text size="sm">The YAML can’t be read; its faults are listed beside.</Text>
            ) : (
              <Form {...editing} value={read.value} />
            ))}
          <Text size="xs" className="dimmed">
            {way === "yaml"
              ? "Ctrl-Space completes. Escape, then Tab, leaves the field. "
              : "Seeds, decoding, limits and closed loops are written as YAML. "}
            The command line takes the same file: <code>buildarena sweep run FILE</code>
          </Text>
        </Stack>
        <Stack style={{ flex: "1 1 300px", minWidth: 0 }} gap="lg">
          {faults.length > 0 && <Faults faults={faults} />}
          {query.isError && refusal === null && settled === text && (
            <ProblemNote error={query.error} retry={() => void query.refetch()} />
          )}
          {query.isError && refusal !== null && refusal.errors.length === 0 && <ProblemNote error={query.error} />}
          <Estimate
            found={faults.length === 0 ? query.data : undefined}
            waiting={faults.length === 0 && !query.isError && !ready}
          />
          <Submit spec={asked.value} ready={ready} />
        </Stack>
      </Group>
    </Stack>
  );
}

function Faults({ faults }: { faults: readonly Fault[] }) {
  return (
    <Alert color="red" role="status" title={faults.length === 1 ? "One fault" : `${faults.length} faults`}>
      {faults.map((fault) => (
        <Text key={`${fault.line} ${fault.message}`} size="sm" style={{ overflowWrap: "anywhere" }}>
          <b>line {fault.line}</b>: {fault.message}
          {fault.choices.length > 0 && <> (choose from {fault.choices.join(", ")})</>}
        </Text>
      ))}
    </Alert>
  );
}

/** How much more a success rate must be for a board to claim that it is. */
function riseWords(rise: number | null): string {
  return rise === null ? "not at all" : `if it is ${Math.round(100 * rise)} points more`;
}

function Estimate({ found, waiting }: { found: Schema<"SweepEstimate"> | undefined; waiting: boolean }) {
  return (
    <Section title="Estimate">
      {found === undefined ? (
        <Text size="sm">{waiting ? "Being made …" : "None, as long as there are faults."}</Text>
      ) : (
        <>
          <Text size="lg" fw={650} className="figures">
            {count(found.jobs)} jobs, {dollars(found.cost_usd)}
          </Text>
          <Text size="sm">
            {count(found.power.trials)} trials of each model on each task tell a success rate from 50 %{" "}
            {riseWords(found.power.on_a_task)} on a task, {riseWords(found.power.overall)} over all;{" "}
            {count(found.power.trials_for_ten_points)} would show 10 points over all.
          </Text>
          <Table.ScrollContainer
            minWidth={300}
            type="native"
            tabIndex={0}
            role="region"
            aria-label="Estimate, scrolls sideways"
          >
            <Table fz="sm" aria-label="Estimate by model">
              <Table.Thead>
                <Table.Tr>
                  <Table.Th>Model</Table.Th>
                  <Table.Th className="figures">Jobs</Table.Th>
                  <Table.Th className="figures">Tokens in, out</Table.Th>
                  <Table.Th className="figures">Cost</Table.Th>
                </Table.Tr>
              </Table.Thead>
              <Table.Tbody>
                {found.models.map((model) => (
                  <Table.Tr key={model.model}>
                    <Table.Td>{model.model}</Table.Td>
                    <Table.Td className="figures">{count(model.jobs)}</Table.Td>
                    <Table.Td className="figures">
                      {compact(model.usage.input_tokens)}, {compact(model.usage.output_tokens)}
                    </Table.Td>
                    <Table.Td className="figures">
                      {model.usage.cost_usd === null ? "no price known" : dollars(model.usage.cost_usd)}
                    </Table.Td>
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </Table.ScrollContainer>
          <Text size="xs" className="dimmed">
            From the mean figures that the paper reports per task; jobs that were submitted before cost nothing again.
          </Text>
        </>
      )}
    </Section>
  );
}

function Submit({ spec, ready }: { spec: Record<string, unknown> | null; ready: boolean }) {
  const navigate = useNavigate();
  const who = useCaller();
  const [error, setError] = useState<unknown>(null);
  const [sending, setSending] = useState(false);
  // One sweep has one key, however often it is sent: a second click, or one after an answer was lost, adds none.
  const keys = useRef(new Map<string, string>());
  const going = useRef(false);
  if (who !== undefined && !has(who, "submit"))
    return <Text size="sm">This key may only read: submitting needs the scope submit.</Text>;
  const send = async (): Promise<void> => {
    if (going.current || spec === null) return;
    going.current = true;
    setSending(true);
    setError(null);
    const content = JSON.stringify(spec);
    const key = keys.current.get(content) ?? freshKey();
    keys.current.set(content, key);
    try {
      const done = await taken(
        client.POST("/v1/sweeps", {
          body: spec as unknown as SweepSpec,
          params: { header: { "Idempotency-Key": key } },
        }),
      );
      await navigate({ to: "/sweeps/$id", params: { id: done.id } });
    } catch (refusal) {
      setError(refusal);
    } finally {
      going.current = false;
      setSending(false);
    }
  };
  return (
    <>
      {error !== null && <ProblemNote error={error} />}
      <Button disabled={!ready} loading={sending} onClick={() => void send()}>
        Submit the sweep
      </Button>
    </>
  );
}
