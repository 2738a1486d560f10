import { Box3, type Object3D } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";

export const MAX_GLB_BYTES = 16 * 1024 * 1024;
export const MAX_NODES = 10_000;
const MAGIC = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const HEADER_BYTES = 20;

export interface GlbShape {
  root: Object3D;
  bounds: Box3;
  nodes: number;
  names: string[];
}

interface Description {
  nodes?: unknown[];
  meshes?: unknown[];
  buffers?: { uri?: unknown }[];
  extensionsRequired?: unknown[];
  [part: string]: unknown;
}

/** What a GLB file says about itself; a file that would make the page fetch or run anything is refused. */
export function describedBy(file: ArrayBuffer): Description {
  if (file.byteLength > MAX_GLB_BYTES)
    throw new Error(`a GLB file may have at most ${MAX_GLB_BYTES / 1024 / 1024} MiB here`);
  if (file.byteLength < HEADER_BYTES) throw new Error("the file is too short to be a GLB");
  const view = new DataView(file);
  if (view.getUint32(0, true) !== MAGIC) throw new Error("the file is no GLB");
  if (view.getUint32(4, true) !== 2)
    throw new Error(`it is of glTF version ${view.getUint32(4, true)}; version 2 is read`);
  const length = view.getUint32(12, true);
  if (view.getUint32(16, true) !== JSON_CHUNK || HEADER_BYTES + length > file.byteLength)
    throw new Error("the GLB is cut off, or does not begin with its description");
  let found: unknown;
  try {
    found = JSON.parse(new TextDecoder().decode(new Uint8Array(file, HEADER_BYTES, length)));
  } catch {
    throw new Error("the GLB's description is not JSON");
  }
  if (typeof found !== "object" || found === null || Array.isArray(found))
    throw new Error("the GLB's description is no object");
  const description = found as Description;
  for (const part of ["nodes", "meshes", "buffers", "extensionsRequired"]) {
    if (description[part] !== undefined && !Array.isArray(description[part]))
      throw new Error(`the GLB's ${part} are no list`);
  }
  const count = (description.nodes?.length ?? 0) + (description.meshes?.length ?? 0);
  if (count > MAX_NODES) throw new Error(`the GLB has ${count} nodes and meshes; at most ${MAX_NODES} are drawn`);
  if (description.buffers?.some((buffer) => typeof buffer !== "object" || "uri" in buffer))
    throw new Error("the GLB refers to data outside of itself");
  if ((description.extensionsRequired?.length ?? 0) > 0)
    throw new Error(`the GLB needs extensions: ${String(description.extensionsRequired).slice(0, 100)}`);
  return description;
}

interface Material {
  pbrMetallicRoughness?: { baseColorFactor?: unknown };
}

/** A material's own colour, and nothing else of it. */
function plain(material: Material): unknown {
  const colour = material.pbrMetallicRoughness?.baseColorFactor;
  const numbers = Array.isArray(colour) && colour.length === 4 && colour.every((value) => typeof value === "number");
  return {
    doubleSided: true,
    pbrMetallicRoughness: {
      ...(numbers ? { baseColorFactor: colour as unknown } : {}),
      metallicFactor: 0,
      roughnessFactor: 1,
    },
  };
}

/** The same file without pictures: they could be anywhere, and shapes need none. */
export function withoutPictures(file: ArrayBuffer, description: Description): ArrayBuffer {
  const bare = structuredClone(description);
  for (const part of [
    "images",
    "textures",
    "samplers",
    "animations",
    "skins",
    "cameras",
    "extensions",
    "extensionsUsed",
  ])
    Reflect.deleteProperty(bare, part);
  for (const mesh of (bare.meshes ?? []) as { primitives?: object[] }[])
    for (const primitive of mesh.primitives ?? []) Reflect.deleteProperty(primitive, "extensions");
  if (Array.isArray(bare.materials)) bare.materials = (bare.materials as Material[]).map(plain);
  for (const node of (bare.nodes ?? []) as Record<string, unknown>[])
    for (const part of ["skin", "camera", "extensions"]) Reflect.deleteProperty(node, part);
  const text = new TextEncoder().encode(JSON.stringify(bare));
  const padded = Math.ceil(text.length / 4) * 4;
  const rest = new Uint8Array(file, HEADER_BYTES + new DataView(file).getUint32(12, true));
  const whole = new Uint8Array(HEADER_BYTES + padded + rest.length).fill(0x20);
  const view = new DataView(whole.buffer);
  [MAGIC, 2, whole.length, padded, JSON_CHUNK].forEach((value, index) => {
    view.setUint32(4 * index, value, true);
  });
  whole.set(text, HEADER_BYTES);
  whole.set(rest, HEADER_BYTES + padded);
  return whole.buffer;
}

/** The shapes of a GLB file. */
export async function readGlb(file: ArrayBuffer): Promise<GlbShape> {
  const description = describedBy(file);
  const { scene } = await new GLTFLoader().parseAsync(withoutPictures(file, description), "");
  // Exporters mostly have y up, as the format asks for; ours does too.
  scene.rotation.x = Math.PI / 2;
  scene.updateMatrixWorld(true);
  const names: string[] = [];
  scene.traverse((node) => {
    if (node.name !== "") names.push(node.name);
  });
  const bounds = new Box3().setFromObject(scene);
  if (bounds.isEmpty() || ![...bounds.min.toArray(), ...bounds.max.toArray()].every(Number.isFinite))
    throw new Error("the GLB has no shapes that can be drawn");
  return { root: scene, bounds, nodes: description.nodes?.length ?? 0, names };
}
