"""Every number of a module that decides a design, in one line made from its module file.

Places and directions are in the block's frame: its origin is where it touches the face it sits on,
and z points away from that face. Forces are in mass·g, moments in mass·g·unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from buildarena_geometry.feedback.words import number, plain, point
from buildarena_geometry.modules.forces import Altitude, Push, Spring, Wing
from buildarena_geometry.modules.joints import Drive, MovingJoint
from buildarena_geometry.modules.module import Module, Motor, Physics

FRAME = (
    "Places and directions in a data line are [x, y, z] from where the module touches the face it "
    "sits on, z away from that face; a starting block's are from its centre."
)


def data_sheet(module: Module, usual: Physics | None) -> str:
    """A module's numbers in one line: how it moves and pushes, its friction, its faces' places.

    Args:
        module: any module but a task's cargo.
        usual: the starting block's physics; friction and drag that are the same are left out.

    Returns:
        Facts with semicolons between them; "" if there is nothing to say.
    """
    places = " ".join(f"{face.label} {point(face.center)}" for face in module.faces)
    faces = [f"faces {places}"] if places else []
    return "; ".join([*_motion(module), *_forces(module), *_body(module, usual), *faces])


def _motion(module: Module) -> Iterator[str]:
    """How it moves on the face it sits on."""
    joint_type = None if module.physics is None else module.physics.joint_type
    if module.motor is not None:
        yield _motor(module.motor)
    elif module.joint is not None and joint_type is not None:
        yield from _joint(module, joint_type, module.joint)
    if joint_type == "mount":
        yield "its mount does not break"
    if module.is_loose:
        yield "nothing holds it on its face"
    if module.gear is not None:
        yield f"pitch radius {plain(module.gear.pitch_radius)}"
    if module.rope_mount is not None:
        yield f"hangs on a rope of {plain(module.rope_mount.length)}"
    if module.grabs:
        yield "far end joins"


def _motor(motor: Motor) -> str:
    reached = f"{number(motor.speed)} rad/s, after about {number(3.0 / motor.lag_per_s)} s"
    torque = f"torque and brake up to {plain(motor.torque)}"
    return f"turns at {plain(motor.speed_rpm)} rpm ({reached}), {torque}"


def _joint(module: Module, joint_type: str, joint: MovingJoint) -> Iterator[str]:
    body = module.body[0].center if module.body else module.center
    through = point(joint.point or body)
    axis = point(joint.axis)
    if joint_type == "ball":
        yield f"turns every way about {through}"
    elif joint_type == "constant_velocity":
        yield f"bends every way about {through}{_limits(joint, joint_type)} and passes torque on"
    elif joint_type == "slider":
        yield f"slides along {axis}{_limits(joint, joint_type)}"
    else:
        yield f"turns about the axis {axis} through {through}{_limits(joint, joint_type)}"
    length = "unit" if joint_type == "slider" else "rad"
    if joint.stiffness:
        yield f"spring {plain(joint.stiffness)} per {length}, at rest as built"
    if joint.damping:
        yield f"damper {plain(joint.damping)} per {length}/s"
    if joint.friction:
        yield f"dry friction {plain(joint.friction)}"
    if joint.drive is not None:
        yield _drive(joint.drive, joint_type)


def _limits(joint: MovingJoint, joint_type: str) -> str:
    if joint.limits is None:
        return ""
    low, high = joint.limits
    if joint_type == "slider":
        return f" from {plain(low)} to {plain(high)} units"
    if joint_type == "constant_velocity":
        return f" up to {number(math.degrees(high))}°"
    return f" from {number(math.degrees(low))}° to {number(math.degrees(high))}°"


_WITHOUT_A_KEY = {
    "hold": "holds with as much without a key",
    "free": "is free without a key",
    "return": "goes back without a key",
    "forward": "runs all the time",
}


def _drive(drive: Drive, joint_type: str) -> str:
    if joint_type == "slider":
        speed, most = f"{plain(drive.rate)} units/s", f"a force up to {plain(drive.force)}"
    else:
        degrees = number(math.degrees(drive.rate))
        speed = f"{number(drive.rate)} rad/s ({degrees}°/s)"
        most = f"a torque up to {plain(drive.force)}"
    return f"driven at {speed} with {most}; {_WITHOUT_A_KEY[drive.default_mode]}"


def _forces(module: Module) -> Iterator[str]:
    """What it pushes, pulls, holds and lets go."""
    push, thrust, grip = module.push, module.thrust, module.grip
    if push is not None:
        yield from _push(push)
    if thrust is not None:
        pushes = f"{plain(thrust.cold)} cold and {plain(thrust.heated)} heated"
        yield f"pushes with {pushes}, against the way it points"
    if module.wing is not None:
        yield _wing(module.wing)
    if module.lift is not None:
        yield f"lift {plain(module.lift.force)}"
    if module.altitude is not None:
        yield _altitude(module.altitude)
    if module.spring is not None:
        yield _spring(module.spring)
    if module.strut is not None:
        yield f"mass {plain(module.mass)} for each unit of length, at least for one"
        yield f"pressed by {math.pi**2 * module.strut.bending_stiffness:.0f} / length² it buckles"
    if module.decouple is not None:
        yield f"lets go with an impulse of {plain(module.decouple.impulse)} mass·units/s each way"
    yield from _in_space(module)
    if grip is not None:
        yield f"holds what comes within {plain(grip.reach)} of its far end, ready from the start"
        yield f"slips at a force of {plain(grip.force)} or a moment of {plain(grip.moment)}"


def _push(push: Push) -> Iterator[str]:
    back = f", {push.reverse} the other way," if push.reverse else ""
    yield f"{push.action} pushes it along {point(push.direction)}{back} with {plain(push.force)}"
    if not push.needs_air:
        yield "needs no air"
    if push.fuel:
        yield f"burns {plain(push.fuel)} of fuel a second at full push"
    if push.steady_speed is not None:
        speed = "u the speed along that way at which it turns about the centre of mass"
        yield f"steadies: pushes by asked - u / {plain(push.steady_speed)} within -1 and 1, {speed}"


def _in_space(module: Module) -> Iterator[str]:
    """Its fuel, flywheel and brake."""
    tank, wheel, brake = module.tank, module.flywheel, module.brake
    if tank is not None:
        if tank.fuel:
            yield f"holds {plain(tank.fuel)} of fuel of mass {plain(tank.mass)}"
        yield "shares fuel with what it is joined to and takes fuel as well"
    if wheel is not None:
        yield (
            f"flywheel: torque up to {plain(wheel.torque)} about {point(wheel.axis)}, {wheel.left} "
            f"counterclockwise seen from outside, until it has spun up by {plain(wheel.momentum)} "
            "mass·units²/s; without a key it brakes, fully from "
            f"{plain(wheel.steady_rate)} rad/s on"
        )
    if brake is not None:
        opens = "once opened" if brake.opens == "once" else "while no key is held"
        force = f"{plain(brake.coefficient)}·v·min(|v|, {plain(brake.cap_speed)})"
        yield f"air brakes it by {force}, in mass·units/s², {opens}"


def _wing(wing: Wing) -> str:
    speed = f"min(|v|, {plain(wing.cap_speed)})"
    grown = f"·{speed}" + (f"^{wing.power}" if wing.power > 1 else "") if wing.power else ""
    flow = "n" if not wing.pitch_deg else "s"
    turned = "" if flow == "n" else f", s = {point(wing.flow, 3)}"
    only = f", only while v·{flow} > 0" if wing.one_sided else ""
    force = f"air pushes it by -{plain(wing.coefficient)}·(v·{flow}){grown} along n"
    return f"{force}, in mass·units/s², n = {point(wing.normal)}{turned}{only}"


def _altitude(held: Altitude) -> str:
    return (
        f"lift {plain(held.stiffness)} per unit below its height less {plain(held.damping)} per "
        f"unit/s of climb, from 0 to {plain(held.most)}; the height is where it starts, "
        f"{held.rise} and {held.sink} move it by {plain(held.rate)} units/s"
    )


def _spring(spring: Spring) -> str:
    shortens = ""
    if spring.contract is not None:
        shortens = (
            f"; {spring.contract} shortens its rest length to {plain(spring.shortest)} of the "
            f"built one, by {plain(spring.rate)} built lengths/s"
        )
    pulls = f"pulls {plain(spring.stiffness)} per unit beyond its rest length"
    damper = f"damper {plain(spring.damping)} per unit/s"
    limit = f"gives way at {plain(spring.limit)}"
    return f"{pulls}, pushes when shorter, {damper}{shortens}; {limit}"


def _body(module: Module, usual: Physics | None) -> Iterator[str]:
    """Its middle, friction and drag, where they are not what one expects."""
    physics = module.physics
    if physics is None:
        return
    if module.size is not None and module.kind != "start":
        middle = (0.0, 0.0, module.size[2] / 2.0)
        if module.center != middle:
            yield f"its position is that of its point {point(module.center)}"
        if physics.mass_at == "body" and module.body and module.body[0].center != module.center:
            yield f"its mass is at {point(module.body[0].center)}"
    if usual is None or physics.friction != usual.friction:
        yield f"friction {plain(physics.friction)}"
    if usual is None or physics.linear_drag != usual.linear_drag:
        yield f"drag {plain(physics.linear_drag)}"
