import type { QueryClient } from "@tanstack/react-query";
import { ApiError } from "./problem";
import { BASE, isSite } from "./site";

const ASK_EVERY_MS = 3_000;

/** Whether nothing answered: the service or the network is away. */
const isAway = (error: unknown): boolean => error instanceof ApiError && (error.status === 0 || error.status >= 502);

/** While the service is away it is asked for again and again; once it is back, what failed is read again. */
export function wakeWithService(queries: QueryClient): void {
  if (isSite) return;
  let timer: ReturnType<typeof setTimeout> | undefined;
  const failed = () => queries.getQueryCache().findAll({ predicate: (query) => isAway(query.state.error) });
  const look = async (): Promise<void> => {
    timer = undefined;
    const back = await fetch(`${BASE}/v1/health`).then(
      (answer) => answer.status < 500,
      () => false,
    );
    if (back) await Promise.all(failed().map((query) => query.fetch().catch(() => undefined)));
    if (failed().length > 0) watch();
  };
  const watch = (): void => {
    timer ??= setTimeout(() => void look(), ASK_EVERY_MS);
  };
  queries.getQueryCache().subscribe(({ query }) => {
    if (isAway(query.state.error)) watch();
  });
}
