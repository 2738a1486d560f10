import { useQueryClient } from "@tanstack/react-query";
import { useCallback, useEffect, useRef } from "react";
import { useEvents, type ServiceEvent, type StreamState } from "../../api/events";
import { job as jobQuery, type JobDetail } from "../../api/queries";
import { prompts as promptsQuery, replay as replayQuery, transcript as transcriptQuery } from "./queries";
import { isWhole, withTurns } from "./replay";
import type { Transcript, Turn } from "./transcript";

interface ToldTurn extends Turn {
  shortened?: boolean;
}

/** The turns that events carry, and whether all of them are complete. */
export function toldIn(events: readonly ServiceEvent[]): { turns: Turn[]; whole: boolean } {
  const turns = events
    .filter((event) => event.kind === "turn")
    .flatMap((event) => (event.data.turn as ToldTurn | undefined) ?? []);
  return { turns, whole: turns.every((turn) => turn.shortened !== true) };
}

/** Keeps a running job current: each turn as it is journalled, everything again after a lost stream. */
export function useLive(job: JobDetail | undefined, id: string): StreamState | "ended" {
  const queries = useQueryClient();
  const open = job !== undefined && job.state !== "done";
  const readAgain = useAgain(
    useCallback(
      () =>
        Promise.all([replayQuery(id), promptsQuery(id)].map(({ queryKey }) => queries.refetchQueries({ queryKey }))),
      [queries, id],
    ),
  );
  const onEvents = useCallback(
    (events: ServiceEvent[]) => {
      const { turns, whole } = toldIn(events);
      const key = transcriptQuery(id).queryKey;
      if (turns.length > 0) {
        const known = queries.getQueryData<Transcript | null>(key);
        const merged = withTurns(known?.turns ?? [], turns);
        if (whole && isWhole(merged)) {
          void queries.cancelQueries({ queryKey: key });
          const now: Transcript = { version: known?.version ?? 1, turns: merged };
          queries.setQueryData(key, now);
        } else void queries.invalidateQueries({ queryKey: key });
        readAgain();
      }
      if (events.some((event) => event.kind !== "turn"))
        void queries.invalidateQueries({ queryKey: jobQuery(id).queryKey });
    },
    [queries, id, readAgain],
  );
  const state = useEvents(open ? `/v1/jobs/${encodeURIComponent(id)}/events` : null, onEvents);
  const before = useRef(state);
  useEffect(() => {
    if (before.current === "broken" && state === "live")
      void queries.invalidateQueries({ queryKey: jobQuery(id).queryKey });
    before.current = state;
  }, [state, queries, id]);
  return open ? state : "ended";
}

/** Does something again whenever it is asked to, one at a time, and once more if it was asked meanwhile. */
function useAgain(work: () => Promise<unknown>): () => void {
  const state = useRef({ busy: false, asked: false });
  return useCallback(() => {
    const now = state.current;
    now.asked = true;
    if (now.busy) return;
    now.busy = true;
    void (async () => {
      while (now.asked) {
        now.asked = false;
        await work().catch(() => undefined);
      }
      now.busy = false;
    })();
  }, [work]);
}
