import { isMap, isNode, isScalar, LineCounter, parseDocument, type Document } from "yaml";
import type { Problem } from "../../../api/problem";
import type { Schema } from "../../../api/client";

export type SweepSpec = Schema<"SweepSpec">;

/** Something wrong with a part of the text; places count characters from its beginning. */
export interface Fault {
  from: number;
  to: number;
  line: number;
  message: string;
  choices: readonly string[];
}

export interface Read {
  /** What the text says, when it is YAML at all. */
  value: Record<string, unknown> | null;
  faults: readonly Fault[];
  document: Document;
  lines: LineCounter;
}

const MAX_ALIASES = 20;

/** Reads a sweep as YAML. What it says is checked by the service alone. */
export function readSpec(text: string): Read {
  const lines = new LineCounter();
  const document = parseDocument(text, { lineCounter: lines, schema: "core", prettyErrors: false });
  const faults = document.errors.map((error) => faultAt(lines, error.pos[0], error.pos[1], error.message));
  if (faults.length > 0) return { value: null, faults, document, lines };
  let value: unknown;
  try {
    value = document.toJS({ maxAliasCount: MAX_ALIASES });
  } catch (error) {
    const message = error instanceof Error ? error.message : "this can't be read";
    return { value: null, faults: [faultAt(lines, 0, 0, message)], document, lines };
  }
  if (!isMap(document.contents)) {
    return {
      value: null,
      faults: [faultAt(lines, 0, text.length, "a sweep is a mapping: name, tasks, models …")],
      document,
      lines,
    };
  }
  return { value: value as Record<string, unknown>, faults: [], document, lines };
}

function faultAt(
  lines: LineCounter,
  from: number,
  to: number,
  message: string,
  choices: readonly string[] = [],
): Fault {
  return { from, to: Math.max(from, to), line: Math.max(1, lines.linePos(from).line), message, choices };
}

/** "tasks[0].name" as the keys that lead there. */
export function keysOf(field: string): (string | number)[] {
  return [...field.matchAll(/\[(\d+)\]|([^.[\]]+)/g)].map((part) =>
    part[1] === undefined ? (part[2] ?? "") : Number(part[1]),
  );
}

/** The place of a field in the text; of the nearest there is around it when it is missing itself. */
function placeOf(document: Document, field: string): [number, number] {
  const keys = keysOf(field);
  for (let depth = keys.length; depth > 0; depth -= 1) {
    const parent = document.getIn(keys.slice(0, depth - 1), true);
    const last = keys[depth - 1];
    if (isMap(parent)) {
      const pair = parent.items.find((item) => (isScalar(item.key) ? item.key.value : item.key) === last);
      const node = isNode(pair?.value) && depth === keys.length ? pair.value : pair?.key;
      if (isNode(node) && node.range) return [node.range[0], node.range[1]];
    }
    const node = document.getIn(keys.slice(0, depth), true);
    if (isNode(node) && node.range) return [node.range[0], node.range[1]];
  }
  return [0, 0];
}

/** The service's refusal at the places that it means. */
export function faultsOf(problem: Problem, read: Read): Fault[] {
  return problem.errors.map(({ field, message, choices }) => {
    const [from, to] = placeOf(read.document, field);
    return faultAt(read.lines, from, to, `${field}: ${message}`, choices);
  });
}

/** The text with one field changed, or taken away; the rest, comments too, stays. */
export function withField(text: string, keys: readonly string[], value: unknown): string {
  const { document, value: known } = readSpec(text);
  if (known === null) return text;
  if (value === undefined) document.deleteIn(keys);
  else document.setIn(keys, Array.isArray(value) ? document.createNode(value, { flow: true }) : value);
  return document.toString({ lineWidth: 110, flowCollectionPadding: false });
}
