import type { Box3, Object3D } from "three";
import { Stage } from "./Stage";
import { Surroundings } from "./Surroundings";

/** Shapes from elsewhere, on the ground. */
export default function GlbScene({ root, bounds, label }: { root: Object3D; bounds: Box3; label: string }) {
  return (
    <Stage bounds={bounds} height={420} label={label} subject={root.uuid}>
      <Surroundings scenario={null} floor={bounds.min.z} />
      <primitive object={root} />
    </Stage>
  );
}
