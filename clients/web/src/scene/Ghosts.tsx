import { useThree } from "@react-three/fiber";
import { useEffect } from "react";
import { EdgesGeometry } from "three";
import { moduleGeometry } from "./geometry";
import { partOf, type PlacedView } from "./machine";

const REFUSED = "#d6336c";

/** Blocks where a refused action would have put them: see-through, with their edges drawn. */
export function Ghosts({ blocks }: { blocks: readonly PlacedView[] }) {
  const invalidate = useThree((state) => state.invalidate);
  useEffect(() => {
    invalidate();
  }, [blocks, invalidate]);
  return blocks.map((block, index) => {
    const { module, pose } = partOf(block);
    const geometry = moduleGeometry(module);
    return (
      <group
        key={`${block.id}-${index}`}
        matrixAutoUpdate={false}
        matrix={pose}
        userData={{ ghost: block.id }}
        onUpdate={(self) => {
          self.matrixWorldNeedsUpdate = true;
        }}
      >
        <mesh geometry={geometry}>
          <meshLambertMaterial
            color={REFUSED}
            transparent
            opacity={0.35}
            depthWrite={false}
            polygonOffset
            polygonOffsetFactor={-2}
            polygonOffsetUnits={-2}
          />
        </mesh>
        <lineSegments geometry={new EdgesGeometry(geometry)}>
          <lineBasicMaterial color={REFUSED} />
        </lineSegments>
      </group>
    );
  });
}
