import { startTransition, useEffect, useState, type ReactNode } from "react";
import { Loading } from "./States";

/** What is made once the rest of a page stands, so that no single task makes all of it; `now`: where it is small. */
export function Later({ rows, now, children }: { rows: number; now: boolean; children: ReactNode }) {
  const [shown, setShown] = useState(now);
  useEffect(() => {
    startTransition(() => {
      setShown(true);
    });
  }, []);
  return shown ? children : <Loading rows={rows} />;
}
