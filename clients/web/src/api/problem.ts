import type { components } from "./contract";
import { isSite } from "./site";

export type Problem = components["schemas"]["Problem"];

/** What the API refused, or why it could not be asked. */
export class ApiError extends Error {
  readonly status: number;
  readonly problem: Problem | null;

  constructor(status: number, problem: Problem | null, message: string) {
    super(message);
    this.name = "ApiError";
    this.status = status;
    this.problem = problem;
  }

  /** Whether asking again can help without anything being changed. */
  get passing(): boolean {
    return this.status === 0 || this.status === 429 || this.status >= 500;
  }
}

function isProblem(value: unknown): value is Problem {
  return typeof value === "object" && value !== null && "detail" in value && "status" in value;
}

/** A failed answer, in words. */
export function refusal(status: number, body: unknown): ApiError {
  if (isProblem(body)) return new ApiError(status, body, body.detail);
  return new ApiError(status, null, `the service answered with status ${status}`);
}

/** A heading for an error, for people. */
export function headline(error: unknown): string {
  if (!(error instanceof ApiError)) return "Something went wrong in the page";
  if (error.status === 0) return isSite ? "A part of this site is missing" : "The service does not answer";
  if (error.status === 401) return "An API key is needed";
  if (error.status === 403) return "This key may not do that";
  if (error.status === 404) return "Not found";
  if (error.status === 409) return "Not allowed in the current state";
  if (error.status === 422) return "The service can’t take this as it is";
  if (error.status === 429) return "Too many requests";
  if (error.status === 503) return "The service is not ready";
  return error.problem?.title ?? "The service refused";
}
