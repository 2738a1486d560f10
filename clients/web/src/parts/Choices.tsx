import { useEffect, useId, useRef, type KeyboardEvent } from "react";

export interface Choice {
  id: string;
  text: string;
  note?: string;
}

const STEPS: Readonly<Record<string, number>> = {
  ArrowDown: 1,
  ArrowRight: 1,
  ArrowUp: -1,
  ArrowLeft: -1,
  Home: -Infinity,
  End: Infinity,
};

/** One of several things, chosen by a click or the arrow keys. */
export function Choices({
  label,
  choices,
  value,
  onChange,
  wide = false,
}: {
  label: string;
  choices: readonly Choice[];
  value: string | undefined;
  onChange: (id: string) => void;
  wide?: boolean;
}) {
  const own = useId();
  const list = useRef<HTMLDivElement>(null);
  const at = choices.findIndex((choice) => choice.id === value);
  useEffect(() => {
    const chosen = list.current?.children[at];
    if (list.current !== null && chosen instanceof HTMLElement) {
      const { offsetTop, offsetHeight } = chosen;
      const { scrollTop, clientHeight } = list.current;
      if (offsetTop < scrollTop || offsetTop + offsetHeight > scrollTop + clientHeight)
        list.current.scrollTop = offsetTop - clientHeight / 2;
    }
  }, [at]);
  const onKeys = (event: KeyboardEvent): void => {
    const by = STEPS[event.key];
    if (by === undefined || choices.length === 0) return;
    event.preventDefault();
    const next = choices[Math.min(choices.length - 1, Math.max(0, at < 0 ? 0 : at + by))];
    if (next !== undefined) onChange(next.id);
  };
  return (
    <div
      ref={list}
      className={wide ? "choices choices-wide" : "choices"}
      role="listbox"
      aria-label={label}
      tabIndex={0}
      aria-activedescendant={at < 0 ? undefined : `${own}-${at}`}
      onKeyDown={onKeys}
    >
      {choices.map((choice, index) => (
        <div
          key={choice.id}
          id={`${own}-${index}`}
          role="option"
          aria-selected={index === at}
          className="choice"
          onClick={() => onChange(choice.id)}
        >
          <span>{choice.text}</span>
          {choice.note !== undefined && <small>{choice.note}</small>}
        </div>
      ))}
    </div>
  );
}
