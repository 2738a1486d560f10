import { BoxGeometry, CylinderGeometry, Quaternion, SphereGeometry, Vector3, type BufferGeometry } from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import { moduleShape, type Solid } from "./modules";

const SIDES = 24;
const Y = new Vector3(0, 1, 0);

function solidGeometry(solid: Solid): BufferGeometry {
  if (solid.shape === "sphere") return new SphereGeometry(solid.radius, SIDES, SIDES / 2).translate(...solid.center);
  const from = new Vector3(...solid.from);
  const to = new Vector3(...solid.to);
  const middle = from.clone().add(to).multiplyScalar(0.5);
  if (solid.shape === "box") {
    const size = to.clone().sub(from);
    return new BoxGeometry(Math.abs(size.x), Math.abs(size.y), Math.abs(size.z)).translate(
      middle.x,
      middle.y,
      middle.z,
    );
  }
  const axis = to.clone().sub(from);
  return new CylinderGeometry(solid.radius, solid.radius, axis.length(), SIDES)
    .applyQuaternion(new Quaternion().setFromUnitVectors(Y, axis.normalize()))
    .translate(middle.x, middle.y, middle.z);
}

const made = new Map<string, BufferGeometry>();

/** The body of a module in the block's frame; shared by all its blocks. */
export function moduleGeometry(name: string): BufferGeometry {
  const known = made.get(name);
  if (known !== undefined) return known;
  const solids = moduleShape(name).body.map(solidGeometry);
  const whole = solids.length === 0 ? new BoxGeometry(1, 1, 1) : mergeGeometries(solids);
  made.set(name, whole);
  return whole;
}
