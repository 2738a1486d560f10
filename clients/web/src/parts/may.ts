import { useQuery } from "@tanstack/react-query";
import { caller, type Caller } from "../api/queries";

const SCOPES = ["read", "submit", "admin"] as const;

/** Whether somebody's key has a scope; each includes those before it. */
export function has(who: Caller | undefined, scope: Caller["scope"]): boolean {
  return who !== undefined && SCOPES.indexOf(who.scope) >= SCOPES.indexOf(scope);
}

/** Whether somebody may change what a key has submitted: their own, or anything as an admin. */
export function mayChange(who: Caller | undefined, owner: string | null): boolean {
  return has(who, "admin") || (has(who, "submit") && who?.key === owner);
}

/** Who the service takes this tab for; undefined until it has said. */
export function useCaller(): Caller | undefined {
  return useQuery(caller()).data;
}
