import { Canvas } from "@react-three/fiber";
import { useRef, type ReactNode } from "react";
import { Object3D, type Box3 } from "three";
import { Camera, FIELD_DEG } from "./Camera";
import { Gauge, GaugeMarks } from "./Gauge";
import type { CameraLock } from "./lock";
import { Sun } from "./Sun";
import type { Scenario } from "./Surroundings";
import { viewOf } from "./views";

// The world's z points up.
Object3D.DEFAULT_UP.set(0, 0, 1);

type Drawing = "none" | "software" | "hardware";

/** Who draws: without a graphics card, smooth edges cost more than they are worth. */
function whoDraws(): Drawing {
  try {
    const context = document.createElement("canvas").getContext("webgl2");
    if (context === null) return "none";
    const names = context.getExtension("WEBGL_debug_renderer_info");
    const name = names === null ? "" : String(context.getParameter(names.UNMASKED_RENDERER_WEBGL));
    context.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|software/i.test(name) ? "software" : "hardware";
  } catch {
    return "none";
  }
}

let drawing: Drawing | null = null;

interface StageProps {
  bounds: Box3;
  /** Pixels; without, it is 16 by 9 as wide as its place. */
  height?: number;
  label: string;
  /** Names what is looked at: the camera stays where it is as long as that stays. */
  subject?: string;
  lock?: CameraLock;
  /** What is seen: it decides from where. */
  scenario?: Scenario | null;
  /** Lines on the picture. */
  caption?: string | null;
  children: ReactNode;
}

/** A view of something of this size: light, and a camera that mouse, touch and keys turn. */
export function Stage({ bounds, height, label, subject = "", lock, scenario = null, caption, children }: StageProps) {
  const needle = useRef<SVGGElement>(null);
  const bar = useRef<HTMLDivElement>(null);
  drawing ??= whoDraws();
  if (drawing === "none") {
    return <p>This browser draws no 3D (WebGL 2 is off).</p>;
  }
  return (
    <div
      className={height === undefined ? "stage-3d stage-wide" : "stage-3d"}
      style={{ height }}
      role="img"
      aria-label={label}
    >
      <Canvas
        frameloop="demand"
        dpr={drawing === "software" ? 1 : [1, 2]}
        shadows={drawing === "hardware"}
        camera={{ up: [0, 0, 1], fov: FIELD_DEG }}
        gl={{ antialias: drawing === "hardware" }}
        onCreated={({ gl, scene, camera }) => {
          // Whoever measures the page reads poses where they are drawn from.
          Object.assign(gl.domElement, { gl, scene, camera });
        }}
      >
        <hemisphereLight args={["#ffffff", "#8a7f70", 1.6]} />
        <Sun bounds={bounds} />
        {children}
        <Camera bounds={bounds} subject={subject} lock={lock} view={viewOf(scenario)} />
        <Gauge needleRef={needle} barRef={bar} />
      </Canvas>
      {caption != null && <p className="stage-caption">{caption}</p>}
      <GaugeMarks needleRef={needle} barRef={bar} />
    </div>
  );
}
