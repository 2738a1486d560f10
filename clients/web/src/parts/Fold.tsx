import { startTransition, useState, type CSSProperties, type ReactNode } from "react";

/** What opens when its title is pressed, and is made only then: tables of thousands of cells are mostly not read. */
export function Fold({
  title,
  size = 13,
  style,
  children,
}: {
  title: string;
  size?: number;
  style?: CSSProperties;
  children: ReactNode;
}) {
  const [opened, setOpened] = useState(false);
  return (
    <details
      style={style}
      onToggle={(event) => {
        if (event.currentTarget.open)
          startTransition(() => {
            setOpened(true);
          });
      }}
    >
      <summary style={{ cursor: "pointer", fontSize: size }}>{title}</summary>
      {opened && children}
    </details>
  );
}
