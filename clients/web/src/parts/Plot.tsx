import * as ObservablePlot from "@observablehq/plot";
import { useElementSize } from "@mantine/hooks";
import { useEffect, useRef } from "react";

const NARROW = 260;

/** A drawing of statistics, as wide as its place; `label` says it to those who don't see it. */
export default function Plot({
  options,
  label,
}: {
  options: (width: number) => ObservablePlot.PlotOptions;
  label: string;
}) {
  const { ref: frame, width } = useElementSize();
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (place.current === null || width < NARROW / 2) return;
    const drawn = ObservablePlot.plot({ ...options(Math.max(NARROW, width)), width: Math.max(NARROW, width) });
    drawn.setAttribute("role", "img");
    drawn.setAttribute("aria-label", label);
    // The whole has a label; groups without a role may have none.
    for (const part of drawn.querySelectorAll("g[aria-label]")) part.removeAttribute("aria-label");
    place.current.replaceChildren(drawn);
    return () => {
      drawn.remove();
    };
  }, [options, width, label]);
  return (
    <div ref={frame}>
      <div ref={place} className="plot" />
    </div>
  );
}
