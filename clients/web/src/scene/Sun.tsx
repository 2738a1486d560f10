import { useFrame, useThree } from "@react-three/fiber";
import { useMemo, useRef } from "react";
import { Vector3, type Box3, type DirectionalLight } from "three";

const TO_THE_SUN = new Vector3(30, -40, 60).normalize();
/** Bounds of the half side of the square in which things cast shadows, units. */
const REACH = [8, 60] as const;

/** Light from one side, which casts shadows around what is looked at where the canvas draws them. */
export function Sun({ bounds }: { bounds: Box3 }) {
  const light = useRef<DirectionalLight>(null);
  const casts = useThree((state) => state.gl.shadowMap.enabled);
  const controls = useThree((state) => state.controls) as { target: Vector3 } | null;
  const reach = useMemo(() => {
    const size = bounds.isEmpty() ? 0 : bounds.getSize(new Vector3()).length();
    return Math.min(REACH[1], Math.max(REACH[0], size));
  }, [bounds]);
  useFrame(() => {
    if (light.current === null || controls === null) return;
    light.current.target.position.copy(controls.target);
    light.current.target.updateMatrixWorld();
    light.current.position.copy(controls.target).addScaledVector(TO_THE_SUN, 2 * reach);
  });
  return (
    <directionalLight
      ref={light}
      position={TO_THE_SUN}
      intensity={2}
      castShadow={casts}
      shadow-mapSize={[2048, 2048]}
      shadow-normalBias={0.03}
    >
      <orthographicCamera attach="shadow-camera" args={[-reach, reach, reach, -reach, 0.1, 4 * reach]} />
    </directionalLight>
  );
}
