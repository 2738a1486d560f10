import type { Hand, SessionView, Tool } from "./session";

/** What a field holds before it is an argument. */
export type Field = string | number | (string | number)[];

export interface Parameter {
  type?: string;
  enum?: string[];
  description?: string;
  minItems?: number;
}

export function parametersOf(tool: Tool): [string, Parameter][] {
  const { properties } = tool.parameters as { properties?: Record<string, Parameter> };
  return Object.entries(properties ?? {});
}

export function isRequired(tool: Tool, name: string): boolean {
  return ((tool.parameters as { required?: string[] }).required ?? []).includes(name);
}

const BLOCKS = new Set(["block_id", "base_block", "block_a", "block_b"]);

/** What a parameter can be at this moment, where that is known; null for anything. */
export function choicesOf(name: string, parameter: Parameter, hand: Hand, view: SessionView): string[] | null {
  if (parameter.enum !== undefined) return parameter.enum;
  if (BLOCKS.has(name)) return hand.bench.parts.map((part) => part.id);
  if (name === "action")
    return [...new Set((hand.part === undefined ? hand.bench.parts : [hand.part]).flatMap((part) => part.actions))];
  if (name === "machine_id") return view.machines.map((one) => one.name).filter((one) => one !== hand.machine);
  if (name === "machine_index") return hand.bench.sub_structures.map((one) => one.letter);
  return null;
}

/** What a field begins with: what is in hand. */
export function firstValue(name: string, parameter: Parameter, hand: Hand, view: SessionView): Field {
  if (parameter.type === "array") return Array.from({ length: parameter.minItems ?? 0 }, () => 0);
  if (parameter.type === "number" || parameter.type === "integer") return 0;
  if (name === "block_a") return hand.from?.part ?? hand.part?.id ?? "";
  if (name === "face_a") return hand.from?.face ?? hand.face?.label ?? "";
  if (BLOCKS.has(name)) return hand.part?.id ?? "";
  if (name === "face" || name === "face_b") return hand.face?.label ?? "";
  const choices = choicesOf(name, parameter, hand, view);
  return choices?.[0] ?? "";
}

/** The arguments that a call is made with; fields left empty are left out where they may be. */
export function argumentsOf(tool: Tool, fields: Readonly<Record<string, Field>>): Record<string, unknown> {
  const found: Record<string, unknown> = {};
  for (const [name, parameter] of parametersOf(tool)) {
    const value = fields[name] ?? "";
    if (value === "" && !isRequired(tool, name)) continue;
    if (Array.isArray(value)) found[name] = value.map(Number);
    else if (parameter.type === "number" || parameter.type === "integer")
      found[name] = value === "" ? null : Number(value);
    else found[name] = value;
  }
  return found;
}
