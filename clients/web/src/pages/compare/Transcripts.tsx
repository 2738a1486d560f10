import { Code, Text } from "@mantine/core";
import { useQueries } from "@tanstack/react-query";
import { useVirtualizer } from "@tanstack/react-virtual";
import { useMemo, useRef } from "react";
import type { JobDetail } from "../../api/queries";
import { words } from "../../format";
import { Empty, Loading } from "../../parts/States";
import { transcript as transcriptQuery } from "../job/queries";
import { callLine, type Transcript, type TurnAction } from "../job/transcript";
import { aligned } from "./differing";

interface Done {
  turn: number;
  /** What was done, without the words it was explained with. */
  key: string;
  line: string;
}

function doneIn(transcript: Transcript | null): Done[] {
  return (transcript?.turns ?? []).flatMap((turn) =>
    turn.actions.map((action) => ({
      turn: turn.index,
      key: keyOf(action),
      line: `${callLine(action)}${action.ok ? "" : ` ✗ ${words(action.reason ?? "refused")}`}`,
    })),
  );
}

function keyOf(action: TurnAction): string {
  const { arguments: given, name, ok } = action;
  const meant =
    typeof given === "object" && given !== null
      ? Object.entries(given)
          .filter(([word]) => word !== "note")
          .sort(([a], [b]) => (a < b ? -1 : 1))
      : given;
  return JSON.stringify([name, meant, ok]);
}

/** The actions of two sessions side by side, what is equal beside each other. */
export function Transcripts({ jobs }: { jobs: readonly [JobDetail, JobDetail] }) {
  const [first, second] = useQueries({ queries: [transcriptQuery(jobs[0].id), transcriptQuery(jobs[1].id)] });
  if (first.data === undefined || second.data === undefined)
    return first.isError || second.isError ? <Empty title="The transcripts could not be read" /> : <Loading />;
  return <Rows a={doneIn(first.data)} b={doneIn(second.data)} />;
}

function Rows({ a, b }: { a: readonly Done[]; b: readonly Done[] }) {
  const frame = useRef<HTMLDivElement>(null);
  const rows = useMemo(
    () =>
      aligned(
        a.map((one) => one.key),
        b.map((one) => one.key),
      ),
    [a, b],
  );
  const list = useVirtualizer({
    count: rows.length,
    getScrollElement: () => frame.current,
    estimateSize: () => 30,
    overscan: 10,
  });
  if (rows.length === 0) return <Empty title="Neither did anything" />;
  const same = rows.filter((row) => row.same).length;
  return (
    <>
      <Text size="sm" role="status" mb="xs">
        {same} of {rows.length} actions are the same; {a.length} in A, {b.length} in B.
      </Text>
      <div
        ref={frame}
        style={{ maxHeight: 520, overflow: "auto" }}
        tabIndex={0}
        role="region"
        aria-label="Actions of both, scrolls"
      >
        <div style={{ height: list.getTotalSize(), position: "relative", minWidth: 300 }}>
          {list.getVirtualItems().map((item) => {
            const row = rows[item.index];
            return (
              row !== undefined && (
                <div
                  key={item.key}
                  ref={list.measureElement}
                  data-index={item.index}
                  className={row.same ? "pair" : "pair differs"}
                  style={{ transform: `translateY(${item.start}px)` }}
                >
                  <span aria-hidden>{row.same ? "=" : "≠"}</span>
                  {[row.a === null ? undefined : a[row.a], row.b === null ? undefined : b[row.b]].map((done, side) => (
                    <div key={side}>
                      {done !== undefined && (
                        <Code
                          style={{ overflowWrap: "anywhere", background: "none" }}
                        >{`${done.turn}  ${done.line}`}</Code>
                      )}
                    </div>
                  ))}
                </div>
              )
            );
          })}
        </div>
      </div>
    </>
  );
}
