import { expect, it } from "vitest";
import type { Caller } from "../api/queries";
import { has, mayChange } from "./permissions";

const SCOPES: Caller["scopes"] = ["read", "submit", "admin"];
const as = (scope: Caller["scopes"][number], key_id: string | null = "key_1"): Caller => ({
  scopes: SCOPES.slice(0, SCOPES.indexOf(scope) + 1),
  key_id,
  keys_required: true,
});

it("each scope includes those before it, and no key has none", () => {
  expect(has(as("submit"), "read")).toBe(true);
  expect(has(as("read"), "submit")).toBe(false);
  expect(has(undefined, "read")).toBe(false);
});

it("what another key submitted only an admin may change", () => {
  expect(mayChange(as("submit"), "key_1")).toBe(true);
  expect(mayChange(as("submit"), "key_2")).toBe(false);
  expect(mayChange(as("submit"), null)).toBe(false);
  expect(mayChange(as("read"), "key_1")).toBe(false);
  expect(mayChange(as("admin", null), "key_2")).toBe(true);
  expect(mayChange(undefined, null)).toBe(false);
});
