import { useFrame } from "@react-three/fiber";
import { useMemo, useRef } from "react";
import { Color, DoubleSide, Vector2, type Mesh, type ShaderMaterial } from "three";

/** Half the side of what is drawn where the camera is near the ground, units. */
const REACH = 90;
/** From which height above it more is drawn, units. */
const HIGH = 12;
const CELL = 4;

const VERTEX = `
varying vec2 place;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  place = world.xy;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

// Lines are where a point of a cell is nearest to its edge: they are not geometry, which software renderers clip.
const FRAGMENT = `
uniform vec2 eye;
uniform float reach;
uniform float cell;
uniform vec3 ground;
uniform vec3 line;
varying vec2 place;
void main() {
  vec2 at = place / cell;
  vec2 width = fwidth(at);
  vec2 near = abs(fract(at - 0.5) - 0.5) / max(width, vec2(1e-6));
  float drawn = (1.0 - min(min(near.x, near.y), 1.0)) * (1.0 - smoothstep(0.25, 0.6, max(width.x, width.y)));
  float seen = 1.0 - smoothstep(0.35 * reach, reach, distance(place, eye));
  gl_FragColor = vec4(mix(ground, line, 0.7 * drawn), 0.6 * seen);
  #include <colorspace_fragment>
}`;

/** The ground around the camera: its lines stay where they are, and it fades before it ends. */
export function Ground({ height }: { height: number }) {
  const mesh = useRef<Mesh>(null);
  const material = useRef<ShaderMaterial>(null);
  const uniforms = useMemo(
    () => ({
      eye: { value: new Vector2() },
      reach: { value: REACH },
      cell: { value: CELL },
      ground: { value: new Color("#c9c5b9") },
      line: { value: new Color("#7d7a70") },
    }),
    [],
  );
  useFrame(({ camera }) => {
    const up = Math.max(1, Math.abs(camera.position.z - height) / HIGH);
    const scale = 2 ** Math.ceil(Math.log2(up));
    mesh.current?.position.set(camera.position.x, camera.position.y, height);
    mesh.current?.scale.setScalar(scale);
    const own = material.current?.uniforms;
    if (own === undefined) return;
    (own.eye?.value as Vector2).set(camera.position.x, camera.position.y);
    Object.assign(own.reach ?? {}, { value: REACH * scale });
    Object.assign(own.cell ?? {}, { value: CELL * scale });
  });
  return (
    <mesh ref={mesh} position={[0, 0, height]} renderOrder={-2} frustumCulled={false} userData={{ ground: true }}>
      <planeGeometry args={[2 * REACH, 2 * REACH]} />
      <shaderMaterial
        ref={material}
        vertexShader={VERTEX}
        fragmentShader={FRAGMENT}
        uniforms={uniforms}
        transparent
        depthWrite={false}
        side={DoubleSide}
      />
    </mesh>
  );
}
