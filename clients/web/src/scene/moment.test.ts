import { Vector3 } from "three";
import { expect, it } from "vitest";
import { readLook, writtenLook } from "./moment";

it("an address has a look and gives it again", () => {
  const look = { offset: new Vector3(0.62, -0.85, 0.5), pan: new Vector3(0, 12.3456, -1) };
  const written = writtenLook(look);
  expect(written).toBe("0.62,-0.85,0.5,0,12.346,-1");
  const again = readLook(written);
  expect(again?.offset.distanceTo(look.offset)).toBeLessThan(1e-3);
  expect(again?.pan.distanceTo(look.pan)).toBeLessThan(1e-3);
});

it.each([undefined, "", "1,2,3", "1,2,3,4,5,x", "1,2,3,4,5,", "0,0,0,1,1,1", "1,2,3,4,5,1e9", "NaN,1,1,1,1,1"])(
  "an invalid look is none: %s",
  (text) => {
    expect(readLook(text)).toBeNull();
  },
);

it("no look is not written", () => {
  expect(writtenLook(null)).toBeUndefined();
});
