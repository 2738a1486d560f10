import { Tooltip } from "@mantine/core";
import { useRef, useState, type ReactNode } from "react";

/** Words that say more while they are pointed at or focused; only then is there a tooltip, for tables have many. */
export function Tip({ label, children }: { label: string; children: ReactNode }) {
  const words = useRef<HTMLSpanElement>(null);
  const [shown, setShown] = useState(false);
  const show = (): void => {
    setShown(true);
  };
  const hide = (): void => {
    setShown(false);
  };
  return (
    <>
      <span
        ref={words}
        tabIndex={0}
        aria-description={label}
        onMouseEnter={show}
        onMouseLeave={hide}
        onFocus={show}
        onBlur={hide}
      >
        {children}
      </span>
      {shown && <Tooltip label={label} target={words} opened />}
    </>
  );
}
