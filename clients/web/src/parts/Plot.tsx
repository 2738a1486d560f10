import * as ObservablePlot from "@observablehq/plot";
import { useElementSize } from "@mantine/hooks";
import { useRouter } from "@tanstack/react-router";
import { useEffect, useRef } from "react";
import { apart, type Box } from "./labels";

const NARROW = 260;
/** The class of points that labels stand beside. */
export const POINTS = "points";
/** The class of labels beside points, and how far from them they stand. */
export const BESIDE = { className: "beside", dx: 10, textAnchor: "start" } as const;
const XLINK = "http://www.w3.org/1999/xlink";

/** A drawing of statistics, as wide as its place; `label` says it to those who don't see it. */
export default function Plot({
  options,
  label,
}: {
  options: (width: number) => ObservablePlot.PlotOptions;
  label: string;
}) {
  const { ref: frame, width } = useElementSize();
  const router = useRouter();
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (place.current === null || width < NARROW / 2) return;
    // One drawing a task: between them the page does what is asked of it.
    const waiting = setTimeout(() => {
      draw(place.current, options(Math.max(NARROW, width)), Math.max(NARROW, width), label);
    });
    return () => {
      clearTimeout(waiting);
    };
  }, [options, width, label]);
  return (
    <div ref={frame}>
      {/* Links of a drawing are no links of the router: it is told where they lead. */}
      <div
        ref={place}
        className="plot"
        onClick={(event) => {
          const to = event.target instanceof Element ? event.target.closest("a")?.getAttribute("href") : null;
          if (to == null || to.startsWith("#") || event.metaKey || event.ctrlKey || event.shiftKey) return;
          event.preventDefault();
          router.history.push(to);
        }}
      />
    </div>
  );
}

function draw(place: Element | null, options: ObservablePlot.PlotOptions, width: number, label: string): void {
  if (place === null) return;
  const drawn = ObservablePlot.plot({ ...options, width });
  const links = [...drawn.querySelectorAll("a")].filter((link) => link.hasAttributeNS(XLINK, "href"));
  // What is an image has nothing to press in it.
  drawn.setAttribute("role", links.length > 0 ? "group" : "img");
  drawn.setAttribute("aria-label", label);
  for (const link of links) {
    link.setAttribute("href", link.getAttributeNS(XLINK, "href") ?? "");
    link.setAttribute("aria-label", link.querySelector("title")?.textContent ?? "");
  }
  // The whole has a label; groups without a role may have none.
  for (const part of drawn.querySelectorAll("g[aria-label]")) part.removeAttribute("aria-label");
  place.replaceChildren(drawn);
  keepApart(drawn);
}

/** Moves labels beside points that cover each other, or that the drawing has no room for. */
function keepApart(drawn: Element): void {
  const labels = [...drawn.querySelectorAll<SVGTextElement>(`.${BESIDE.className} text`)];
  const whole = drawn.getBoundingClientRect();
  const boxOf = (part: Element): Box => {
    const { x, y, width, height } = part.getBoundingClientRect();
    return { x: x - whole.x, y: y - whole.y, width, height };
  };
  const points = [...drawn.querySelectorAll(`.${POINTS} > *`)].map(boxOf);
  for (const [index, shift] of apart(labels.map(boxOf), points, whole, BESIDE.dx).entries()) {
    const label = labels[index];
    if (shift === null) label?.remove();
    else if (label !== undefined) label.style.translate = `${shift.dx}px ${shift.dy}px`;
  }
}
