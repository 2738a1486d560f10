import { expect, it } from "vitest";
import { after, inverseOf, NO_HISTORY, redone, undone } from "./history";
import { mirrored } from "./mirror";
import { stepsOf } from "./remix";
import type { BenchPart } from "./session";

const attach = (base: string, block = "Wheel") => ({
  tool: "attach_block_to",
  arguments: { base_block: base, face: "A", new_block: block },
});

it("takes back what was made, the last part first", () => {
  const done = { calls: [attach("1"), attach("2")], made: ["7", "8"] };
  expect(inverseOf(done)?.map((call) => call.arguments.block_id)).toEqual(["8", "7"]);
  const twist = { tool: "twist_block", arguments: { block_id: "3", angle: 90 } };
  expect(inverseOf({ calls: [twist], made: [] })).toEqual([{ ...twist, arguments: { block_id: "3", angle: -90 } }]);
  expect(inverseOf({ calls: [{ tool: "remove_block", arguments: { block_id: "3" } }], made: [] })).toBeNull();
});

it("does again what was taken back, though its parts have other names now", () => {
  let history = after(NO_HISTORY, { calls: [attach("1")], made: ["2"] });
  history = after(history, { calls: [attach("2", "2")], made: ["3"] });
  history = undone(undone(history));
  expect(history.past).toEqual([]);
  history = redone(history, { calls: [attach("1")], made: ["4"] });
  // A module's name stays, whatever it is.
  expect(history.next.at(-1)?.calls).toEqual([attach("4", "2")]);
  expect(history.past.at(-1)?.made).toEqual(["4"]);
});

it("forgets what came before something that cannot be undone, and not what was only looked at", () => {
  const history = after(NO_HISTORY, { calls: [attach("1")], made: ["2"] });
  expect(after(history, { calls: [{ tool: "get_block_details", arguments: {} }], made: [] })).toBe(history);
  expect(after(history, { calls: [{ tool: "reset", arguments: {} }], made: [] })).toEqual(NO_HISTORY);
});

it("finds the free face on the other side", () => {
  const face = (label: string, x: number, taken_by: string | null = null) => ({
    label,
    side: "",
    center: [x, 1, 0],
    normal: [Math.sign(x), 0, 0],
    taken_by,
  });
  const parts = [
    { id: "1", faces: [face("A", 1), face("B", -1)] },
    { id: "2", faces: [face("A", 2), face("B", -2, "9"), face("C", 0)] },
  ] as unknown as BenchPart[];
  expect(mirrored(parts, { part: "1", face: "A" })).toEqual({ part: "1", face: "B" });
  expect(mirrored(parts, { part: "2", face: "A" })).toBeUndefined();
  expect(mirrored(parts, { part: "2", face: "C" })).toBeUndefined();
});

it("repeats how a machine came about, its parts first and without what was refused", () => {
  const entry = (name: string, reason: string | null = null) => ({ name, arguments: {}, reason });
  const tower = { log: [entry("start"), entry("attach_block_to", "overlap")], available: {} };
  expect(stepsOf(tower).map(({ machine, call }) => [machine, call.tool])).toEqual([["main", "start"]]);
  const whole = { log: [entry("add_machine")], available: { tower } };
  expect(stepsOf(whole).map(({ machine, call }) => [machine, call.tool])).toEqual([
    ["tower", "start"],
    ["assembly", "add_machine"],
  ]);
});
