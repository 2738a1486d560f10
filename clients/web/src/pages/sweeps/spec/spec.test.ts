import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import type { Problem } from "../../../api/problem";
import { suggestionsAt, type SchemaNode } from "./completion";
import { faultsOf, keysOf, readSpec, withField } from "./spec";

const TEXT = "name: a # mine\ntasks: [lift-1, nope]\nmodels:\n  - builtin/idle\n  - x\ndecoding:\n  temperature: 9\n";

function problem(...fields: string[]): Problem {
  const errors = fields.map((field) => ({ field, message: "is wrong", choices: [], line: null }));
  return { type: "about:blank", title: "", status: 422, code: "invalid_field", detail: "", errors };
}

describe("a sweep as YAML", () => {
  it("is read, and what is no YAML is a fault at its line", () => {
    expect(readSpec(TEXT).value).toMatchObject({ tasks: ["lift-1", "nope"], decoding: { temperature: 9 } });
    const broken = readSpec("name: a\ntasks: [lift-1\nmodels: b\n");
    expect(broken.value).toBeNull();
    expect(broken.faults[0]?.line).toBeGreaterThanOrEqual(2);
  });

  it.each(["", "- a\n- b\n", "just text", "1"])("that is no mapping is said to be none: %j", (text) => {
    expect(readSpec(text).faults[0]?.message).toContain("mapping");
  });

  it("bounds how often aliases multiply", () => {
    const bomb = `a: &a [x,x,x,x,x,x,x,x,x]\n${"bcdefghi"
      .split("")
      .map(
        (name, i) =>
          `${name}: &${name} [${Array(9)
            .fill(`*${"abcdefgh"[i] ?? "a"}`)
            .join(",")}]`,
      )
      .join("\n")}\n`;
    expect(readSpec(bomb).value).toBeNull();
  });

  it("has the service's faults at their lines", () => {
    const faults = faultsOf(
      problem("tasks[1]", "models[1]", "decoding.temperature", "samples", "decoding.nothing"),
      readSpec(TEXT),
    );
    expect(faults.map((fault) => fault.line)).toEqual([2, 5, 7, 1, 6]);
    expect(TEXT.slice(faults[0]?.from, faults[0]?.to)).toBe("nope");
  });

  it("keeps comments when a form changes a field", () => {
    const changed = withField(TEXT, ["decoding", "temperature"], 0.5);
    expect(changed).toContain("# mine");
    expect(readSpec(changed).value).toMatchObject({ decoding: { temperature: 0.5 } });
    expect(readSpec(withField(changed, ["budget", "max_cost_usd"], 3)).value).toMatchObject({
      budget: { max_cost_usd: 3 },
    });
    expect(readSpec(withField(TEXT, ["decoding"], undefined)).value).not.toHaveProperty("decoding");
    expect(withField("tasks: [", ["name"], "b")).toBe("tasks: [");
  });

  it("has fields by their keys", () => {
    expect(keysOf("tasks[0]")).toEqual(["tasks", 0]);
    expect(keysOf("limits.max_duration_s")).toEqual(["limits", "max_duration_s"]);
  });
});

describe("completion", () => {
  const schema = JSON.parse(
    readFileSync(new URL("../../../../../../docs/sweep.schema.json", import.meta.url), "utf8"),
  ) as SchemaNode;
  const known = { tasks: ["lift-1", "lift-2"], models: ["builtin/idle"] };
  const labels = (text: string): string[] =>
    (suggestionsAt(text, text.length, schema, known)?.suggestions ?? []).map((one) => one.label);

  it("offers the schema's keys, and those of a part within it", () => {
    expect(labels("na")).toContain("name");
    expect(labels("name: a\n")).toContain("budget");
    expect(labels("name: a\nbudget:\n  ")).toEqual(["max_cost_usd", "max_tokens", "max_requests"]);
    expect(labels("closed_loop:\n  rounds: 3\n  ")).toContain("analyst");
  });

  it("offers what the service has, in both ways of lists", () => {
    expect(labels("tasks: [")).toEqual(["lift-1", "lift-2"]);
    expect(labels("tasks: [lift-1, li")).toEqual(["lift-1", "lift-2"]);
    expect(labels("tasks:\n  - ")).toEqual(["lift-1", "lift-2"]);
    expect(labels("name: x\nmodels:\n- bu")).toEqual(["builtin/idle"]);
    expect(labels("one_shot: ")).toEqual(["true", "false"]);
    expect(labels("name: ")).toEqual([]);
  });

  it("completes the word that was begun, and nothing in a comment", () => {
    expect(suggestionsAt("tasks: [li", 10, schema, known)?.from).toBe(8);
    expect(suggestionsAt("# about ", 8, schema, known)).toBeNull();
  });
});
