import { useCallback, useEffect, useRef, useState } from "react";
import { key as apiKey } from "../../api/key";
import { BASE } from "../../api/site";
import type { Scene } from "../job/queries";
import { liveOf, takeFrame, type Live } from "../../scene/live";

export interface Ready {
  type: "ready";
  scene: Scene;
  keys: Record<string, string[]>;
  duration_s: number;
  job: string | null;
}

export interface Ended {
  type: "ended";
  why: string;
  detail: string;
  time_s: number;
  presses: { time_s: number; key: string; hold_for_s: number }[];
  job: string | null;
}

type News =
  | Ready
  | Ended
  | { type: "broke"; joints: string[]; time_s: number }
  | { type: "problem"; problem: { detail: string } };

export interface Drive {
  phase: "idle" | "opening" | "driving" | "ended";
  ready: Ready | null;
  live: Live | null;
  ended: Ended | null;
  problem: string | null;
  broke: readonly string[];
  held: ReadonlySet<string>;
  begin: (hello: Record<string, unknown>) => void;
  hold: (key: string, down: boolean) => void;
  release: () => void;
  end: () => void;
}

const NONE: ReadonlySet<string> = new Set();
const FRESH = { phase: "idle", ready: null, live: null, ended: null, problem: null, broke: [], held: NONE } as const;

type State = Omit<Drive, "begin" | "hold" | "release" | "end">;

/** A drive over a socket: what is held goes there, where everything is comes back. */
export function useDrive(): Drive {
  const socket = useRef<WebSocket | null>(null);
  const number = useRef(0);
  const held = useRef<ReadonlySet<string>>(NONE);
  const [state, setState] = useState<State>(FRESH);
  useEffect(
    () => () => {
      socket.current?.close();
    },
    [],
  );
  const say = useCallback((message: Record<string, unknown>): void => {
    if (socket.current?.readyState === WebSocket.OPEN) socket.current.send(JSON.stringify(message));
  }, []);
  const begin = useCallback((hello: Record<string, unknown>): void => {
    socket.current?.close();
    held.current = NONE;
    setState({ ...FRESH, phase: "opening" });
    const own = new WebSocket(`${window.location.origin.replace(/^http/, "ws")}${BASE}/v1/drives`);
    own.binaryType = "arraybuffer";
    socket.current = own;
    let live: Live | null = null;
    let ready: Ready | null = null;
    own.onopen = () => {
      own.send(JSON.stringify({ ...hello, key: apiKey() }));
    };
    own.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
      if (typeof data !== "string") {
        if (live === null) return;
        takeFrame(live, data, performance.now());
        // Its first place is known now, so that the camera knows where to look.
        if (ready !== null) setState((before) => ({ ...before, phase: "driving", ready, live }));
        ready = null;
        return;
      }
      const news = JSON.parse(data) as News;
      if (news.type === "ready") {
        ready = news;
        live = liveOf(news.scene);
      } else if (news.type === "broke") {
        setState((before) => ({ ...before, broke: [...before.broke, ...news.joints] }));
      } else if (news.type === "ended") {
        setState((before) => ({ ...before, phase: "ended", ended: news, held: NONE }));
      } else {
        setState({ ...FRESH, problem: news.problem.detail });
      }
    };
    own.onclose = () => {
      if (socket.current !== own) return;
      setState((before) =>
        before.phase === "ended" || before.problem !== null
          ? before
          : { ...FRESH, problem: "The line to the service broke. What was driven until then counts as it is." },
      );
    };
  }, []);
  const tell = useCallback(
    (next: ReadonlySet<string>): void => {
      held.current = next;
      number.current += 1;
      say({ held: [...next], number: number.current });
      setState((before) => ({ ...before, held: next }));
    },
    [say],
  );
  const hold = useCallback(
    (name: string, down: boolean): void => {
      if (held.current.has(name) === down) return;
      const next = new Set(held.current);
      if (down) next.add(name);
      else next.delete(name);
      tell(next);
    },
    [tell],
  );
  const release = useCallback((): void => {
    if (held.current.size > 0) tell(NONE);
  }, [tell]);
  const end = useCallback((): void => {
    say({ end: true });
  }, [say]);
  return { ...state, begin, hold, release, end };
}
