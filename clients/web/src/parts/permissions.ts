import { useQuery } from "@tanstack/react-query";
import { caller, type Caller } from "../api/queries";

/** Whether a user's key has a scope; the service lists all that it includes. */
export function has(who: Caller | undefined, scope: Caller["scopes"][number]): boolean {
  return who?.scopes.includes(scope) ?? false;
}

/** Whether a user may change what a key has submitted: their own, or anything as an admin. */
export function mayChange(who: Caller | undefined, owner: string | null): boolean {
  return has(who, "admin") || (has(who, "submit") && who?.key_id === owner);
}

/** Who the service takes this tab for; undefined until it has said. */
export function useCaller(): Caller | undefined {
  return useQuery(caller()).data;
}
