import { useMutation } from "@tanstack/react-query";
import { sentFile, type Schema } from "../../api/client";
import { ApiError, refusal } from "../../api/problem";
import type { JobView } from "../../api/queries";
import type { GlbShape } from "./glb";

export type Check = Schema<"MachineCheckView">;

export const MAX_BYTES = 2 * 1024 * 1024;
const GLB = "glTF";

export interface Dropped {
  file: File;
  glb: GlbShape | null;
  check: Check | null;
}

/** What a file is told to be by its first bytes, and what it holds. */
async function looked(file: File, task: string | null): Promise<Dropped> {
  const beginning = await file.slice(0, GLB.length).text();
  if (beginning === GLB) {
    const { MAX_GLB_BYTES, readGlb } = await import("./glb");
    if (file.size > MAX_GLB_BYTES)
      throw new Error(`a GLB file may have at most ${MAX_GLB_BYTES / 1024 / 1024} MiB here`);
    return { file, glb: await readGlb(await file.arrayBuffer()), check: null };
  }
  if (file.size > MAX_BYTES)
    throw new Error(
      `a machine's file may have at most ${MAX_BYTES / 1024 / 1024} MiB; this one has ${(file.size / 1024 / 1024).toFixed(1)} MiB`,
    );
  return { file, glb: null, check: await sentFile<Check>("/v1/machines/check", task === null ? {} : { task }, file) };
}

/** The same, and a refusal that names the file. */
async function lookedAt(file: File, task: string | null): Promise<Dropped> {
  try {
    return await looked(file, task);
  } catch (error) {
    if (error instanceof ApiError && error.status !== 422) throw error;
    const detail = error instanceof Error ? error.message : "unknown error";
    throw refusal(422, { type: "about:blank", title: `${file.name} is not read`, status: 422, detail, errors: [] });
  }
}

export const useLook = () =>
  useMutation({ mutationFn: ({ file, task }: { file: File; task: string | null }) => lookedAt(file, task) });

/** A machine's file put through a task's trial, on no leaderboard. */
export const triedFile = ({ file, ...query }: { file: File; task: string; simulator: string }) =>
  sentFile<JobView>("/v1/machines/trials", query, file);

export const useTrial = () => useMutation({ mutationFn: triedFile });
