import { OrbitControls } from "@react-three/drei";
import { Canvas } from "@react-three/fiber";
import { Text } from "@mantine/core";
import type { ReactNode } from "react";
import { Object3D, Vector3, type Box3 } from "three";

// The world's z points up.
Object3D.DEFAULT_UP.set(0, 0, 1);

const FIELD_DEG = 40;

function canDraw(): boolean {
  try {
    return document.createElement("canvas").getContext("webgl2") !== null;
  } catch {
    return false;
  }
}

/** A view of something of this size: light, ground, and a camera that mouse, touch and keys turn. */
export function Stage({ bounds, height, label, children }: { bounds: Box3; height: number; label: string; children: ReactNode }) {
  if (!canDraw()) {
    return <Text size="sm">This browser draws no 3D (WebGL 2 is off): the parts are listed below.</Text>;
  }
  const center = bounds.getCenter(new Vector3());
  const size = Math.max(4, bounds.getSize(new Vector3()).length());
  const distance = (size / 2 / Math.tan((FIELD_DEG * Math.PI) / 360)) * 1.05;
  const eye = center.clone().add(new Vector3(0.62, -0.85, 0.5).normalize().multiplyScalar(distance));
  return (
    <div className="stage-3d" style={{ height }} role="img" aria-label={label}>
      <Canvas
        frameloop="demand"
        dpr={[1, 2]}
        camera={{ position: [eye.x, eye.y, eye.z], up: [0, 0, 1], fov: FIELD_DEG, near: distance / 200, far: distance * 60 }}
        gl={{ antialias: true }}
      >
        <hemisphereLight args={["#ffffff", "#8a7f70", 1.6]} />
        <directionalLight position={[30, -40, 60]} intensity={2} />
        {children}
        <OrbitControls makeDefault target={center} enableDamping={false} maxDistance={distance * 20} />
      </Canvas>
    </div>
  );
}
