import { queryOptions, useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { useMemo, useState } from "react";
import { after, inverseOf, NO_HISTORY, redone, undone, type Done, type History } from "./history";
import { bytesOf, client, jsonOf, sentFile, taken, type Schema } from "../../api/client";
import type { Job } from "../../api/queries";

export type SessionView = Schema<"Session">;
export type Bench = Schema<"WorkbenchMachine">;
export type BenchPart = Schema<"WorkbenchPart">;
export type Face = Schema<"Face">;
export type Tool = Schema<"Tool">;
export type Outcome = Schema<"ToolOutcome">;
export type ModuleView = Schema<"Module">;

export const MAIN = "main";
export const ASSEMBLY = "assembly";

export const session = (id: string) =>
  queryOptions({
    queryKey: ["session", id],
    queryFn: () => jsonOf<SessionView>(`/v1/sessions/${encodeURIComponent(id)}`),
  });

/** A trial of the current machine in a practice world and on no leaderboard; the session continues. */
export async function triedAsItStands({ job }: SessionView, simulator: string): Promise<Job> {
  const machine = await bytesOf(`/v1/sessions/${job.id}/machine`);
  return sentFile<Job>("/v1/machines/trials", { task: job.task, simulator }, machine);
}

/** The modules that a task offers. */
export const modules = (task: string, version: string) =>
  queryOptions({
    queryKey: ["modules", task, version],
    staleTime: Infinity,
    queryFn: async () => {
      const asked = new URLSearchParams({ task, version }).toString();
      return (await jsonOf<Schema<"ModuleList">>(`/v1/modules?${asked}`)).data;
    },
  });

const EMPTY: Bench = {
  name: MAIN,
  parts: [],
  control_sequence: [],
  controller: "",
  sub_structures: [],
  available: [],
  mass: 0,
  detached: [],
};

/** A machine of the workbench; one that was not begun is empty. */
export function benchOf(view: SessionView, name: string): Bench {
  return (
    view.machines.find((machine) => machine.name === name) ?? {
      ...EMPTY,
      name,
      available: name === ASSEMBLY ? view.machines.map((one) => one.name) : [],
    }
  );
}

export interface Call {
  tool: string;
  arguments: Record<string, unknown>;
}

export interface CallResult extends Call {
  outcome: Outcome;
}

/** The parts that were not there before: what actions have made, in their order. */
export function newParts(before: readonly BenchPart[], after: readonly BenchPart[]): string[] {
  const known = new Set(before.map((part) => part.id));
  return after.map((part) => part.id).filter((id) => !known.has(id));
}

export interface Place {
  part: string;
  face: string;
}

export interface Hand {
  bench: Bench;
  machine: string;
  setMachine: (name: string) => void;
  part: BenchPart | undefined;
  face: Face | undefined;
  from: Place | undefined;
  fromFace: Face | undefined;
  setFrom: (place: Place | undefined) => void;
  choose: (part: string | undefined, face?: string) => void;
  act: (...calls: Call[]) => void;
  /** Takes the last thing back, or does what was taken back again; null where there is nothing. */
  undo: (() => void) | null;
  redo: (() => void) | null;
  /** The module that would be attached next, while the pointer is on it. */
  ghost: string | undefined;
  setGhost: (module: string | undefined) => void;
  busy: boolean;
  result: CallResult | undefined;
  error: Error | null;
}

/** Calls that are made, and what the history is once they were. */
interface Doing {
  calls: Call[];
  then: (before: History, done: Done) => History;
}

/** What a person has in hand: the machine, the chosen part and face, and the result of the last action. */
export function useHand(view: SessionView): Hand {
  const id = view.job.id;
  const queries = useQueryClient();
  const [machine, setMachine] = useState(() =>
    view.machines.some((one) => one.name === ASSEMBLY) ? ASSEMBLY : (view.machines.at(-1)?.name ?? MAIN),
  );
  const [chosen, setChosen] = useState<{ part?: string; face?: string }>({});
  const [from, setFrom] = useState<Place>();
  const [ghost, setGhost] = useState<string>();
  const [history, setHistory] = useState(NO_HISTORY);
  const bench = useMemo(() => benchOf(view, machine), [view, machine]);
  const doing = useMutation({
    mutationFn: async ({ calls }: Doing): Promise<CallResult | undefined> => {
      let result: CallResult | undefined;
      for (const call of calls) {
        const body = { tool: call.tool, arguments: call.arguments, machine };
        const outcome = await taken(
          client.POST("/v1/sessions/{session_id}/calls", { params: { path: { session_id: id } }, body }),
        );
        result = { ...call, outcome };
        if (!outcome.ok) break;
      }
      return result;
    },
    // Whatever the result, also without an answer: the service knows the machine.
    onSettled: async (result, _, { calls, then }) => {
      const now = await queries.query({ ...session(id), staleTime: 0 });
      await queries.invalidateQueries({ queryKey: ["job", id, "transcript"] });
      const made = newParts(bench.parts, benchOf(now, machine).parts);
      const last = made.at(-1);
      if (last !== undefined) setChosen({ part: last });
      if (result?.outcome.ok === true) setHistory((before) => then(before, { calls, made }));
      // Of several some may have been done: none of them can be taken back by itself.
      else if (calls.length > 1 || result === undefined) setHistory(NO_HISTORY);
    },
  });
  const part = bench.parts.find((one) => one.id === chosen.part);
  const [back, forth] = [history.past.at(-1), history.next.at(-1)];
  const inverse = back === undefined ? null : inverseOf(back);
  return {
    bench,
    machine,
    setMachine: (name) => {
      setMachine(name);
      setHistory(NO_HISTORY);
      setChosen({});
      setFrom(undefined);
    },
    part,
    face: part?.faces.find((one) => one.label === chosen.face),
    from,
    fromFace: bench.parts.find((one) => one.id === from?.part)?.faces.find((one) => one.label === from?.face),
    setFrom,
    choose: (next, face) => {
      setChosen({ part: next, face });
    },
    act: (...calls) => {
      if (!doing.isPending) doing.mutate({ calls, then: after });
    },
    undo:
      back === undefined || inverse === null
        ? null
        : () => {
            if (!doing.isPending) doing.mutate({ calls: inverse, then: undone });
          },
    redo:
      forth === undefined
        ? null
        : () => {
            if (!doing.isPending) doing.mutate({ calls: [...forth.calls], then: redone });
          },
    ghost,
    setGhost,
    busy: doing.isPending,
    result: doing.data,
    error: doing.error,
  };
}

const LAST = "buildarena-session";

/** The session that was built in last: on this device only, and no secret. */
export function lastSession(): string | null {
  return localStorage.getItem(LAST);
}

export function rememberSession(id: string): void {
  localStorage.setItem(LAST, id);
}

/** The session that can be gone on with, if it is still open. */
export function useLastSession(): SessionView | undefined {
  const id = lastSession();
  const query = useQuery({ ...session(id ?? ""), enabled: id !== null && /^job_[0-9a-f]+$/.test(id), retry: false });
  return query.data?.open === true ? query.data : undefined;
}
