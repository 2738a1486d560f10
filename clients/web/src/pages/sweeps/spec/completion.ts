/** What a schema says of a value, as far as completion needs it. */
export interface SchemaNode {
  type?: string;
  description?: string;
  properties?: Readonly<Record<string, SchemaNode>>;
  items?: SchemaNode;
  anyOf?: readonly SchemaNode[];
  $ref?: string;
  $defs?: Readonly<Record<string, SchemaNode>>;
}

export interface Suggestion {
  label: string;
  detail: string;
  isKey: boolean;
}

export interface Suggested {
  /** Where the word begins that is completed. */
  from: number;
  suggestions: readonly Suggestion[];
}

/** Values that fields can have, by the field's name. */
export type Known = Readonly<Record<string, readonly string[]>>;

function resolved(schema: SchemaNode, root: SchemaNode): SchemaNode {
  const name = schema.$ref?.split("/").at(-1);
  if (name !== undefined) return root.$defs?.[name] ?? {};
  const choice = schema.anyOf?.find((one) => one.$ref !== undefined || (one.type !== undefined && one.type !== "null"));
  return choice === undefined ? schema : resolved(choice, root);
}

function at(root: SchemaNode, path: readonly string[]): SchemaNode {
  let found = root;
  for (const key of path) found = resolved(found.properties?.[key] ?? {}, root);
  return found;
}

function indent(line: string): number {
  return line.length - line.trimStart().length;
}

/** The keys above a line that it belongs to, by their indentation. */
function pathAbove(lines: readonly string[], depth: number): string[] {
  const path: string[] = [];
  let least = depth;
  for (const line of [...lines].reverse()) {
    const key = /^\s*([\w-]+):\s*(#.*)?$/.exec(line)?.[1];
    if (key !== undefined && indent(line) < least) {
      path.unshift(key);
      least = indent(line);
    }
  }
  return path;
}

/** What could stand at a place of a sweep's YAML: keys from the schema, values from the service. */
export function suggestionsAt(text: string, place: number, schema: SchemaNode, known: Known): Suggested | null {
  const before = text.slice(0, place).split("\n");
  const line = before.at(-1) ?? "";
  const values = (field: string, word: string): Suggested => ({
    from: place - word.length,
    suggestions: (
      known[field] ?? (resolved(schema.properties?.[field] ?? {}, schema).type === "boolean" ? ["true", "false"] : [])
    ).map((label) => ({ label, detail: "", isKey: false })),
  });
  const inFlow = /([\w-]+):\s*\[(?:[^\]]*,)?\s*([\w./-]*)$/.exec(line);
  if (inFlow !== null) return values(inFlow[1] ?? "", inFlow[2] ?? "");
  const item = /^\s*-\s+([\w./-]*)$/.exec(line);
  if (item !== null) return values(pathAbove(before.slice(0, -1), indent(line) + 1).at(-1) ?? "", item[1] ?? "");
  const value = /^\s*([\w-]+):\s+([\w./-]*)$/.exec(line);
  if (value !== null) return values(value[1] ?? "", value[2] ?? "");
  const key = /^(\s*)([\w-]*)$/.exec(line);
  if (key === null) return null;
  const depth = (key[1] ?? "").length;
  const node = at(schema, depth === 0 ? [] : pathAbove(before.slice(0, -1), depth));
  return {
    from: place - (key[2] ?? "").length,
    suggestions: Object.entries(node.properties ?? {}).map(([label, about]) => ({
      label,
      detail: resolved(about, schema).description ?? about.description ?? "",
      isKey: true,
    })),
  };
}
