import { OrbitControls } from "@react-three/drei";
import { useThree } from "@react-three/fiber";
import { useEffect, useMemo, useRef } from "react";
import { Vector3, type Box3 } from "three";
import type { CameraLock, Look } from "./lock";

export const FIELD_DEG = 40;
const SMALLEST = 4;
/** The camera is aimed again at a subject that has grown by this factor. */
const GROWTH = 1.35;

interface Aim {
  center: Vector3;
  distance: number;
}

function aimOf(bounds: Box3): Aim {
  const size = Math.max(SMALLEST, bounds.isEmpty() ? 0 : bounds.getSize(new Vector3()).length());
  const center = bounds.isEmpty() ? new Vector3() : bounds.getCenter(new Vector3());
  return { center, distance: (size / 2 / Math.tan((FIELD_DEG * Math.PI) / 360)) * 1.05 };
}

interface Orbit {
  target: Vector3;
  update: () => void;
}

interface CameraProps {
  bounds: Box3;
  subject: string;
  lock?: CameraLock;
  /** The way from what is looked at to the camera, at first. */
  view: Vector3;
}

/** A camera that mouse, touch and keys turn; `subject` names what it looks at, and a new one is aimed at again. */
export function Camera({ bounds, subject, lock, view }: CameraProps) {
  const camera = useThree((state) => state.camera);
  const invalidate = useThree((state) => state.invalidate);
  const controls = useThree((state) => state.controls) as Orbit | null;
  const aim = useMemo(() => aimOf(bounds), [bounds]);
  const aimed = useRef<(Aim & { subject: string }) | null>(null);
  const moving = useRef(false);
  useEffect(() => {
    if (controls === null) return;
    const before = aimed.current;
    const grown =
      before !== null &&
      (aim.distance > GROWTH * before.distance || aim.center.distanceTo(before.center) > before.distance / 3);
    if (before !== null && before.subject === subject && !grown) return;
    aimed.current = { ...aim, subject };
    camera.position.copy(aim.center).addScaledVector(view, aim.distance);
    Object.assign(camera, { near: aim.distance / 200, far: aim.distance * 60 });
    camera.updateMatrix();
    (camera as { updateProjectionMatrix?: () => void }).updateProjectionMatrix?.();
    controls.target.copy(aim.center);
    // Aiming is not a look of the user's: cameras that share one do not follow.
    moving.current = true;
    controls.update();
    moving.current = false;
    invalidate();
  }, [aim, subject, view, camera, controls, invalidate]);
  const follow = useMemo(
    () => (look: Look) => {
      const own = aimed.current;
      if (own === null || controls === null) return;
      moving.current = true;
      controls.target.copy(own.center).addScaledVector(look.pan, own.distance);
      camera.position.copy(controls.target).addScaledVector(look.offset, own.distance);
      controls.update();
      moving.current = false;
      invalidate();
    },
    [camera, controls, invalidate],
  );
  useEffect(() => lock?.join(follow), [lock, follow]);
  return (
    <OrbitControls
      makeDefault
      enableDamping={false}
      maxDistance={aim.distance * 20}
      onChange={() => {
        const own = aimed.current;
        if (lock === undefined || moving.current || own === null || controls === null) return;
        const pan = controls.target.clone().sub(own.center).divideScalar(own.distance);
        lock.share({ pan, offset: camera.position.clone().sub(controls.target).divideScalar(own.distance) }, follow);
      }}
    />
  );
}
