import { QueryClient } from "@tanstack/react-query";
import { ApiError } from "./problem";

const TRIES = 2;

/** What the service answered, for all pages. */
export const queries = new QueryClient({
  defaultOptions: {
    queries: {
      retry: (tries, error) => tries < TRIES && error instanceof ApiError && error.passing,
      staleTime: 2_000,
    },
  },
});
