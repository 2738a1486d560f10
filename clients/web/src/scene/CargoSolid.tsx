import type { CargoShape } from "./trial";

/** What a cargo looks like: a box, or a ball whose facets show that it rolls. */
export function CargoSolid({ size, shape }: { size: readonly [number, number, number]; shape: CargoShape }) {
  return (
    <>
      {shape === "ball" ? <icosahedronGeometry args={[size[0] / 2, 2]} /> : <boxGeometry args={[...size]} />}
      <meshLambertMaterial color="#859966" flatShading={shape === "ball"} transparent opacity={0.85} />
    </>
  );
}
