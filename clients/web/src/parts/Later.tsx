import { startTransition, useEffect, useState, type ReactNode } from "react";
import { Loading } from "./States";

/** What is made once the rest of a page stands, so that no single task makes all of it. */
export function Later({ rows, children }: { rows: number; children: ReactNode }) {
  const [shown, setShown] = useState(false);
  useEffect(() => {
    startTransition(() => {
      setShown(true);
    });
  }, []);
  return shown ? children : <Loading rows={rows} />;
}
