import { Vector3 } from "three";
import type { Look } from "./lock";

/** What a user saw of a trial, and when. */
export interface Moment {
  time: number;
  look: Look | null;
}

const FARTHEST = 1000;

/** A look as an address has it: six figures with commas between them; nothing for none. */
export function writtenLook(look: Look | null): string | undefined {
  if (look === null) return undefined;
  return [...look.offset.toArray(), ...look.pan.toArray()].map((figure) => String(Number(figure.toFixed(3)))).join(",");
}

/** The look of an address; null where it is none. */
export function readLook(text: string | undefined): Look | null {
  const figures = (text ?? "").split(",").map((figure) => (figure.trim() === "" ? NaN : Number(figure)));
  if (figures.length !== 6 || !figures.every((figure) => Math.abs(figure) < FARTHEST)) return null;
  const offset = new Vector3().fromArray(figures);
  return offset.length() < 1e-3 ? null : { offset, pan: new Vector3().fromArray(figures, 3) };
}
