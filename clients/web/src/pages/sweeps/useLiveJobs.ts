import { useQuery, useQueryClient } from "@tanstack/react-query";
import { useCallback, useEffect, useRef, useState } from "react";
import { client, taken } from "../../api/client";
import { useEvents, type ServiceEvent, type StreamState } from "../../api/events";
import { jobPages, sweep as sweepQuery, sweepTroubles, type Job } from "../../api/queries";
import { LiveJobs, type Moment } from "./live";

/** How often the page is drawn again, and what ended is read, at most. */
const DRAW_MS = 1_000;
const READ_MS = 3_000;

export interface Live {
  moment: Moment | null;
  complete: boolean;
  stream: StreamState;
  error: unknown;
}

async function readPages(id: string, take: (page: readonly Job[]) => void, live: () => boolean): Promise<number> {
  const before = await taken(client.GET("/v1/sweeps/{sweep_id}", { params: { path: { sweep_id: id } } }));
  for await (const page of jobPages({ sweep: id, order: "asc" })) {
    if (!live()) return before.last_event;
    take(page);
    // Whoever clicks meanwhile is answered first.
    await new Promise((resolve) => setTimeout(resolve));
  }
  return before.last_event;
}

/** Reads the jobs of a sweep that ended last, so many of them at least. */
async function readEnded(id: string, wanted: number, take: (page: readonly Job[]) => void): Promise<void> {
  let read = 0;
  for await (const page of jobPages({ sweep: id, state: "done", sort: "finished" })) {
    take(page);
    read += page.length;
    if (read >= wanted) return;
  }
}

/** The jobs of a sweep: read once, page after page, then kept true by events and by what ended since. */
export function useLiveJobs(id: string): Live {
  const queries = useQueryClient();
  const [moment, setMoment] = useState<Moment | null>(null);
  const jobs = useRef(new LiveJobs());
  const drawing = useRef<ReturnType<typeof setTimeout> | null>(null);
  const reading = useRef<ReturnType<typeof setTimeout> | null>(null);
  const ended = useRef(0);

  const draw = useCallback((): void => {
    drawing.current ??= setTimeout(() => {
      drawing.current = null;
      setMoment(jobs.current.moment());
    }, DRAW_MS);
  }, []);

  const initial = useQuery({
    queryKey: ["sweep-jobs", id],
    gcTime: 0,
    staleTime: Infinity,
    queryFn: async ({ signal }) => {
      const fresh = new LiveJobs();
      jobs.current = fresh;
      const after = await readPages(
        id,
        (page) => {
          fresh.add(page);
          setMoment(fresh.moment());
        },
        () => !signal.aborted,
      );
      setMoment(fresh.moment());
      return after;
    },
  });

  /** Reads in full what ended since the last time, and the sweep's own figures. */
  const catchUp = useCallback((): void => {
    reading.current ??= setTimeout(() => {
      reading.current = null;
      const wanted = ended.current;
      ended.current = 0;
      void queries.invalidateQueries({ queryKey: sweepQuery(id).queryKey });
      void queries.invalidateQueries({ queryKey: sweepTroubles(id).queryKey });
      readEnded(id, wanted, (page) => {
        jobs.current.add(page);
        draw();
      })
        // The next event brings the next try.
        .catch(() => undefined);
    }, READ_MS);
  }, [draw, id, queries]);

  const onEvents = useCallback(
    (events: ServiceEvent[]) => {
      ended.current += jobs.current.apply(events);
      draw();
      catchUp();
    },
    [catchUp, draw],
  );
  const path = initial.data === undefined ? null : `/v1/sweeps/${encodeURIComponent(id)}/events`;
  const stream = useEvents(path, onEvents, initial.data ?? 0);
  useEffect(
    () => () => {
      for (const timer of [drawing, reading]) {
        if (timer.current !== null) clearTimeout(timer.current);
        timer.current = null;
      }
    },
    [],
  );
  return { moment, complete: initial.data !== undefined, stream, error: initial.error };
}
