import { createRoot } from "react-dom/client";
import { readGiven } from "./given";
import { Viewer } from "./Viewer";

const STYLE = `
  :root { color-scheme: light dark; font: 13px/1.4 system-ui, sans-serif; }
  body { margin: 0; overflow: hidden; }
  h1 { margin: 0; padding: 0 10px; font-size: 14px; line-height: 42px; white-space: nowrap; overflow: hidden; text-overflow: ellipsis; }
  .stage-3d { position: relative; }
  .gauge { position: absolute; right: 10px; bottom: 8px; display: flex; align-items: end; gap: 10px; pointer-events: none; font-size: 11px; }
  .gauge-bar { border: 1px solid currentColor; border-top: 0; text-align: center; overflow: hidden; height: 17px; line-height: 15px; }
  .gauge-face { fill: Canvas; fill-opacity: 0.7; stroke: currentColor; }
  .gauge-needle, .gauge text { fill: currentColor; }
  .controls { display: flex; gap: 10px; align-items: center; height: 42px; padding: 0 10px; white-space: nowrap; }
  .controls input[type="range"] { flex: 1; min-width: 60px; }
  .controls label { display: inline-flex; gap: 4px; align-items: center; }
`;

/** Shows what the page carries; without it, says so. */
async function show(root: HTMLElement): Promise<void> {
  const carried = document.getElementById("given")?.textContent ?? "";
  const given = await readGiven(carried.trim());
  const style = document.createElement("style");
  style.textContent = STYLE;
  document.head.append(style);
  root.textContent = "";
  createRoot(root).render(<Viewer given={given} height={window.innerHeight} />);
}

const root = document.getElementById("root");
if (root !== null) {
  show(root).catch((error: unknown) => {
    root.textContent = `This can't be shown: ${String(error)}`;
  });
}
