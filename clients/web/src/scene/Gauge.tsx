import { useFrame, useThree } from "@react-three/fiber";
import type { RefObject } from "react";
import { Vector3, type PerspectiveCamera } from "three";
import { northOnScreen, roundLength } from "./gauge";

const MOST_PX = 110;

interface GaugeProps {
  needleRef: RefObject<SVGGElement | null>;
  barRef: RefObject<HTMLDivElement | null>;
}

/** Turns the compass and measures the scale with what the camera sees. */
export function Gauge({ needleRef, barRef }: GaugeProps) {
  const controls = useThree((state) => state.controls) as { target: Vector3 } | null;
  useFrame(({ camera, size }) => {
    const target = controls?.target ?? new Vector3();
    const ahead = target.clone().sub(camera.position);
    needleRef.current?.setAttribute("transform", `rotate(${northOnScreen(ahead).toFixed(1)})`);
    const seen = 2 * Math.tan(((camera as PerspectiveCamera).fov * Math.PI) / 360) * ahead.length();
    const length = roundLength((MOST_PX * seen) / size.height);
    if (barRef.current !== null) {
      barRef.current.style.width = `${((length * size.height) / seen).toFixed(0)}px`;
      barRef.current.textContent = `${length} unit${length === 1 ? "" : "s"}`;
    }
  });
  return null;
}

/** Overlay of a drawing: the way to the north, and how long a unit is where the camera looks. */
export function GaugeMarks({ needleRef, barRef }: GaugeProps) {
  return (
    <div className="gauge" aria-hidden>
      <div ref={barRef} className="gauge-bar" />
      <svg width="34" height="34" viewBox="-17 -17 34 34">
        <circle r="16" className="gauge-face" />
        <g ref={needleRef}>
          <path d="M0,-12 L4,2 L0,-1 L-4,2 Z" className="gauge-needle" />
          <text y="13" textAnchor="middle" fontSize="9">
            N
          </text>
        </g>
      </svg>
    </div>
  );
}
