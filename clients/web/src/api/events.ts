import { createParser } from "eventsource-parser";
import { useEffect, useRef, useState } from "react";
import { authorization } from "./key";
import { BASE, isSite } from "./site";

export interface ServiceEvent {
  id: number;
  kind: string;
  job_id: string | null;
  at: string;
  data: Record<string, unknown>;
}

export type StreamState = "connecting" | "live" | "broken";

const FIRST_WAIT_MS = 1_000;
const LONGEST_WAIT_MS = 15_000;

/** An event as it was sent, or null when it is none of ours. */
export function readEvent(id: string | undefined, kind: string | undefined, text: string): ServiceEvent | null {
  try {
    const data = JSON.parse(text) as Record<string, unknown>;
    return {
      id: Number(id ?? 0),
      kind: kind ?? "message",
      job_id: typeof data.job_id === "string" ? data.job_id : null,
      at: typeof data.at === "string" ? data.at : "",
      data,
    };
  } catch {
    return null;
  }
}

/** Reads a stream until it ends; the browser's own EventSource could not send a key. */
async function readStream(
  path: string,
  lastId: number,
  signal: AbortSignal,
  onOpen: () => void,
  onEvents: (events: ServiceEvent[]) => void,
): Promise<void> {
  const headers = { ...authorization(), "Last-Event-ID": String(lastId), Accept: "text/event-stream" };
  const response = await fetch(BASE + path, { headers, signal });
  if (!response.ok || response.body === null) throw new Error(`status ${response.status}`);
  onOpen();
  let batch: ServiceEvent[] = [];
  const parser = createParser({
    onEvent: (event) => {
      const read = readEvent(event.id, event.event, event.data);
      if (read !== null) batch.push(read);
    },
  });
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    parser.feed(value);
    if (batch.length > 0) onEvents(batch);
    batch = [];
  }
}

/**
 * Listens to a stream of events as long as the component is there; connects again by itself.
 * `after` is the event up to which everything is known when it begins.
 */
export function useEvents(path: string | null, onEvents: (events: ServiceEvent[]) => void, after = 0): StreamState {
  const [state, setState] = useState<StreamState>("connecting");
  const handler = useRef(onEvents);
  const begin = useRef(after);
  useEffect(() => {
    handler.current = onEvents;
    begin.current = after;
  });
  useEffect(() => {
    if (path === null || isSite) return;
    const ending = new AbortController();
    let lastId = begin.current;
    let wait = FIRST_WAIT_MS;
    const listen = async (): Promise<void> => {
      while (!ending.signal.aborted) {
        try {
          await readStream(
            path,
            lastId,
            ending.signal,
            () => {
              setState("live");
              wait = FIRST_WAIT_MS;
            },
            (events) => {
              lastId = Math.max(lastId, ...events.map((event) => event.id));
              handler.current(events);
            },
          );
        } catch {
          // Whatever broke it: the loop checks for remaining listeners.
        }
        setState("broken");
        await new Promise((resolve) => setTimeout(resolve, wait));
        wait = Math.min(2 * wait, LONGEST_WAIT_MS);
      }
    };
    void listen();
    return () => {
      ending.abort();
    };
  }, [path]);
  return state;
}
