import { expect, it } from "vitest";
import { baseOf } from "./site";

it("has a base path where the page's address begins with it, and none elsewhere", () => {
  expect(baseOf("/arena", "/arena/jobs")).toBe("/arena");
  expect(baseOf("/arena", "/arena/")).toBe("/arena");
  expect(baseOf("/arena", "/arenas/jobs")).toBe("");
  expect(baseOf("/arena", "/")).toBe("");
  expect(baseOf(null, "/arena/")).toBe("");
});
