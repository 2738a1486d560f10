import createClient, { type Middleware } from "openapi-fetch";
import type { components, paths } from "./contract";
import { authorization } from "./key";
import { keptAnswer } from "./site-cache";
import { ApiError, refusal } from "./problem";
import { BASE, isSite } from "./site";

export type Schema<Name extends keyof components["schemas"]> = components["schemas"][Name];

const withKey: Middleware = {
  onRequest({ request }) {
    for (const [name, value] of Object.entries(authorization())) request.headers.set(name, value);
    return request;
  },
};

/** Where every answer comes from: the service, or a published site's files. */
const ask = (request: Request): Promise<Response> => (isSite ? keptAnswer(request) : fetch(request));

export const client = createClient<paths>({
  baseUrl: `${BASE}/`,
  fetch: ask,
  querySerializer: { array: { style: "form", explode: true } },
});
client.use(withKey);

/** The data of an answer, or its problem as an error. */
export async function taken<Data>(asked: Promise<{ data?: Data; error?: unknown; response: Response }>): Promise<Data> {
  let answer;
  try {
    answer = await asked;
  } catch (error) {
    if (error instanceof ApiError) throw error;
    throw new ApiError(0, null, "no answer came: is it running, and is the network there?");
  }
  if (!answer.response.ok || answer.data === undefined) {
    throw refusal(answer.response.status, answer.error);
  }
  return answer.data;
}

/** The answer to a file that is sent as it is. */
export async function sentFile<Data>(path: string, query: Record<string, string>, file: BodyInit): Promise<Data> {
  let response: Response;
  try {
    response = await fetch(`${BASE}${path}?${new URLSearchParams(query).toString()}`, {
      method: "POST",
      body: file,
      headers: { ...authorization(), "Content-Type": "application/octet-stream" },
    });
  } catch {
    throw new ApiError(0, null, "no answer came: is it running, and is the network there?");
  }
  const answer = (await response.json().catch(() => null)) as unknown;
  if (!response.ok) throw refusal(response.status, answer);
  return answer as Data;
}

/** Bytes that the contract does not describe, such as artifacts. */
export async function bytesOf(path: string, accept = "*/*"): Promise<ArrayBuffer> {
  let response: Response;
  try {
    response = await ask(new Request(BASE + path, { headers: { ...authorization(), Accept: accept } }));
  } catch (error) {
    if (error instanceof ApiError) throw error;
    throw new ApiError(0, null, "no answer came: is it running, and is the network there?");
  }
  if (!response.ok) {
    throw refusal(response.status, await response.json().catch(() => null));
  }
  return response.arrayBuffer();
}

export async function jsonOf<Data>(path: string): Promise<Data> {
  const bytes = await bytesOf(path, "application/json");
  return JSON.parse(new TextDecoder().decode(bytes)) as Data;
}

/** Saves what the API answers with; a link could not carry the key. */
export async function download(path: string, name: string): Promise<void> {
  save(new Blob([await bytesOf(path)]), name);
}

/** Saves a file where the reader keeps downloads. */
export function save(data: Blob, name: string): void {
  const url = URL.createObjectURL(data);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
