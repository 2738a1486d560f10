import { startTransition, useState, type ReactNode } from "react";

/** What opens when its title is pressed, and is made only then: tables of thousands of cells are mostly not read. */
export function Collapsible({ title, children }: { title: string; children: ReactNode }) {
  const [opened, setOpened] = useState(false);
  return (
    <details
      onToggle={(event) => {
        if (event.currentTarget.open) startTransition(() => setOpened(true));
      }}
    >
      <summary style={{ cursor: "pointer", fontSize: 13 }}>{title}</summary>
      {opened && children}
    </details>
  );
}
