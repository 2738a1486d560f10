"""A module's design parameters in one line, made from its module file.

Places and directions are in the block's frame: its origin is where it touches the face it sits on,
and z points away from that face. Forces are in mass·g, moments in mass·g·unit.
"""

import math
from collections.abc import Iterator

from buildarena_geometry.feedback.words import number, plain
from buildarena_geometry.modules.forces import Altitude, Push, Spring, Wing
from buildarena_geometry.modules.joints import Drive, MovingJoint
from buildarena_geometry.modules.module import Module, Motor, Physics
from buildarena_geometry.rotations import Vector

FRAME = (
    "A module's coordinates (x,y,z) begin where it touches the face it sits on, z away from that "
    "face; the starting block's at its centre."
)


def data_sheet(module: Module, usual: Physics | None) -> str:
    """Return a module's numbers in one line: its motion, forces, friction and drag.

    Args:
        module: any module except a task's cargo.
        usual: the starting block's physics; friction and drag that are the same are left out.

    Returns:
        Facts with semicolons between them; "" if there is nothing to say.
    """
    return "; ".join([*_motion(module), *_forces(module), *_body(module, usual)])


def faces_of(module: Module) -> str:
    """List the letters of a module's faces with their centres: "A(0.5,0,0) B(-0.5,0,0)"."""
    return " ".join(f"{face.label}{_place(face.center)}" for face in module.faces)


def _place(vector: Vector, decimals: int = 2) -> str:
    """Format a position in few characters: "(0.5,0,0)"."""
    return f"({','.join(number(value, decimals) for value in vector)})"


def _motion(module: Module) -> Iterator[str]:
    """Describe its motion on the face it sits on."""
    joint_type = None if module.physics is None else module.physics.joint_type
    if module.motor is not None:
        yield _motor(module.motor)
    elif module.joint is not None and joint_type is not None:
        yield from _joint(module, joint_type, module.joint)
    if joint_type == "mount":
        yield "joint does not break"
    if module.is_loose:
        yield "not held on its face"
    if module.gear is not None:
        yield f"pitch radius {plain(module.gear.pitch_radius)}"
    if module.rope_mount is not None:
        yield f"rope of {plain(module.rope_mount.length)}"
    if module.grabs:
        yield "far end joins"


def _motor(motor: Motor) -> str:
    reached = f"{number(motor.speed)} rad/s after {number(3.0 / motor.lag_per_s)} s"
    return f"motor {reached}, torque and brake up to {plain(motor.torque)}"


def _joint(module: Module, joint_type: str, joint: MovingJoint) -> Iterator[str]:
    body = module.body[0].center if module.body else module.center
    through = _place(joint.point or body)
    axis = _axis(joint.axis)
    if joint_type == "ball":
        yield f"turns freely about {through}"
    elif joint_type == "constant_velocity":
        yield f"bends about {through}{_limits(joint, joint_type)}, transmits torque"
    elif joint_type == "slider":
        yield f"slides along {axis}{_limits(joint, joint_type)}"
    else:
        yield f"turns about {axis} through {through}{_limits(joint, joint_type)}"
    length = "unit" if joint_type == "slider" else "rad"
    if joint.stiffness:
        yield f"spring {plain(joint.stiffness)}/{length}"
    if joint.damping:
        yield f"damper {plain(joint.damping)} s/{length}"
    if joint.friction:
        yield f"dry friction {plain(joint.friction)}"
    if joint.drive is not None:
        yield _drive(joint.drive, joint_type)


def _axis(direction: Vector) -> str:
    """Format a direction, by its letter if it is an axis of the module: "z", "-y"."""
    for letter, value in zip("xyz", direction, strict=True):
        if abs(value) == 1.0:
            return letter if value > 0 else f"-{letter}"
    return _place(direction)


def _limits(joint: MovingJoint, joint_type: str) -> str:
    if joint.limits is None:
        return ""
    low, high = joint.limits
    if joint_type == "slider":
        return f" {plain(low)} to {plain(high)}"
    if joint_type == "constant_velocity":
        return f" up to {number(math.degrees(high))}°"
    return f" {number(math.degrees(low))}° to {number(math.degrees(high))}°"


_WITHOUT_A_KEY = {
    "hold": "holds without a key",
    "free": "free without a key",
    "return": "returns without a key",
    "forward": "always runs",
}


def _drive(drive: Drive, joint_type: str) -> str:
    if joint_type == "slider":
        speed, limit = f"{plain(drive.rate)} units/s", f"force up to {plain(drive.force)}"
    else:
        speed, limit = f"{number(drive.rate)} rad/s", f"torque up to {plain(drive.force)}"
    return f"drive {speed}, {limit}, {_WITHOUT_A_KEY[drive.default_mode]}"


def _forces(module: Module) -> Iterator[str]:
    """Describe its forces: those that push, pull, hold and release."""
    push, thrust, grip = module.push, module.thrust, module.grip
    if push is not None:
        yield from _push(push)
    if thrust is not None:
        yield f"thrust {plain(thrust.cold)} cold, {plain(thrust.heated)} heated"
    if module.wing is not None:
        yield _wing(module.wing)
    if module.lift is not None:
        yield f"lift {plain(module.lift.force)}"
    if module.altitude is not None:
        yield _altitude(module.altitude)
    if module.spring is not None:
        yield _spring(module.spring)
    if module.strut is not None:
        yield f"mass {plain(module.mass)} per unit of length, at least for one"
        yield f"buckles at {math.pi**2 * module.strut.bending_stiffness:.0f} / length²"
    if module.decouple is not None:
        yield f"releases with impulse {plain(module.decouple.impulse)} mass·units/s each way"
    yield from _in_space(module)
    if grip is not None:
        yield f"holds what comes within {plain(grip.reach)} of its far end, ready from the start"
        yield f"slips at force {plain(grip.force)} or moment {plain(grip.moment)}"


def _push(push: Push) -> Iterator[str]:
    back = f", {push.reverse} opposite" if push.reverse else ""
    yield f"{push.action} pushes {plain(push.force)} along {_axis(push.direction)}{back}"
    if not push.needs_air:
        yield "needs no air"
    if push.fuel:
        yield f"burns {plain(push.fuel)} fuel/s at full push"
    if push.steady_speed is not None:
        speed = "u: its speed along that axis from rotation about the centre of mass"
        yield f"share of push: command - u / {plain(push.steady_speed)} in -1 to 1, {speed}"


def _in_space(module: Module) -> Iterator[str]:
    """Describe its fuel, flywheel and brake."""
    tank, wheel, brake = module.tank, module.flywheel, module.brake
    if tank is not None:
        if tank.fuel:
            yield f"holds {plain(tank.fuel)} fuel of mass {plain(tank.mass)}"
        yield "shares fuel with joined tanks and engines"
    if wheel is not None:
        yield (
            f"torque up to {plain(wheel.torque)} about {_axis(wheel.axis)}, {wheel.left} "
            f"counterclockwise seen from outside, up to {plain(wheel.momentum)} mass·units²/s of "
            f"spin; brakes without a key, fully above {plain(wheel.steady_rate)} rad/s"
        )
    if brake is not None:
        opens = "once opened" if brake.opens == "once" else "while no key is held"
        force = f"{plain(brake.coefficient)}·v·min(|v|, {plain(brake.cap_speed)})"
        yield f"air drag {force} mass·units/s² {opens}"


def _wing(wing: Wing) -> str:
    speed = f"min(|v|, {plain(wing.cap_speed)})"
    grown = f"·{speed}" + (f"^{wing.power}" if wing.power > 1 else "") if wing.power else ""
    flow = "n" if not wing.pitch_deg else "s"
    turned = "" if flow == "n" else f", s = {_place(wing.flow, 3)}"
    only = f", only while v·{flow} > 0" if wing.one_sided else ""
    force = f"air force -{plain(wing.coefficient)}·(v·{flow}){grown}·n mass·units/s²"
    return f"{force}, n = {_place(wing.normal)}{turned}{only}"


def _altitude(held: Altitude) -> str:
    return (
        f"lift {plain(held.stiffness)} per unit below its target height - {plain(held.damping)} "
        f"per unit/s of climb, 0 to {plain(held.most)}; the target is its start height, "
        f"{held.rise} and {held.sink} move it at {plain(held.rate)} units/s"
    )


def _spring(spring: Spring) -> str:
    shortens = ""
    if spring.contract is not None:
        shortens = (
            f"; {spring.contract} shortens its rest length to {plain(spring.shortest)} of the "
            f"built one, at {plain(spring.rate)} built lengths/s"
        )
    pulls = f"pulls {plain(spring.stiffness)} per unit beyond its rest length, pushes when shorter"
    return (
        f"{pulls}, damper {plain(spring.damping)} s/unit{shortens}; breaks at {plain(spring.limit)}"
    )


def _body(module: Module, usual: Physics | None) -> Iterator[str]:
    """Describe its middle, friction and drag, where they differ from the usual."""
    physics = module.physics
    if physics is None:
        return
    if module.size is not None and module.kind != "start":
        middle = (0.0, 0.0, module.size[2] / 2.0)
        if module.center != middle:
            yield f"position at {_place(module.center)}"
        if physics.mass_at == "body" and module.body and module.body[0].center != module.center:
            yield f"mass at {_place(module.body[0].center)}"
    if usual is None or physics.friction != usual.friction:
        yield f"friction {plain(physics.friction)}"
    if usual is None or physics.linear_drag != usual.linear_drag:
        yield f"drag {plain(physics.linear_drag)}"
