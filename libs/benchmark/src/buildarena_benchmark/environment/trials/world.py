"""The world that machines are tried in, in a paragraph made from the simulators' constants."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

from buildarena_benchmark import Task
from buildarena_geometry import Catalogue, Module
from buildarena_geometry.blocks import JOINT_REACH
from buildarena_geometry.feedback.data_sheets import FRAME
from buildarena_geometry.feedback.words import number, plain
from buildarena_geometry.modules.joints import MESH_COSINE, MESH_SLACK
from buildarena_simulation import constants
from buildarena_simulation.constants import JOINT_STRENGTH, JointKind

_ARM = 4.0
"""Length of the lever that the paragraph reckons through, units."""


def world_text(catalogue: Catalogue, names: Collection[str], task: Task | None = None) -> str:
    """What the numbers of modules mean and what breaks, as far as these modules are concerned.

    Args:
        catalogue: The modules.
        names: Those that may be used, beside the starting block.
        task: What of the world its statement tells or does not tell; None for the usual world.
    """
    modules = [catalogue.start, *(catalogue[name] for name in names)]
    return " ".join([units_text(catalogue, task), *_strengths(modules), *_sharing(modules)])


def units_text(catalogue: Catalogue, task: Task | None = None) -> str:
    """What the numbers of modules mean: gravity, units of forces, friction, drag, places."""
    return " ".join([*_forces(task), *_units(catalogue.start)])


def _forces(task: Task | None) -> Iterator[str]:
    """Gravity and the unit of forces; of what is drawn no more than that it is."""
    gravity = plain(constants.GRAVITY)
    unknowns = None if task is None else task.unknowns
    if task is not None and task.scenario.planet is not None:
        known = "Gravity and air are the planet's, which the task tells."
    elif unknowns is not None and unknowns.gravity is not None:
        known = "Gravity is drawn and not told."
    else:
        known = ""
    if known:
        yield (
            f"{known} A force of 1 gives a mass of 1 {gravity} units/s² where nothing else acts; "
            "torques and moments are such forces times units."
        )
    else:
        yield (
            f"Gravity is {gravity} units/s². A force of 1 holds up a mass of 1, and gives it "
            f"{gravity} units/s² where nothing else acts; torques and moments are such forces "
            "times units."
        )
    if unknowns is not None and unknowns.drive_strength is not None:
        yield "How strong drives are against their data is drawn and not told."


def _units(start: Module) -> Iterator[str]:
    physics = start.physics
    if physics is not None:
        yield (
            f"A module has a friction of {plain(physics.friction)} against ground, terrain and "
            f"cargo and loses {plain(physics.linear_drag)} of its velocity per second to the air, "
            "unless its data say other figures."
        )
    yield FRAME


def _strengths(modules: Collection[Module]) -> Iterator[str]:
    joint = JOINT_STRENGTH[JointKind.ATTACHMENT]
    turning = {
        module.physics.joint_type for module in modules if module.physics and module.joint
    } | {"axle" for module in modules if module.motor}
    others = ["a brace"] if _links(modules, "rigid") else []
    if turning:
        others.append("a joint that moves")
    same = f"; so does {' and '.join(others)}" if others else ""
    lever = joint.moment / _ARM
    yield (
        f"A joint between modules breaks at a force of {plain(joint.force)} or a moment of "
        f"{plain(joint.moment)}, whichever it has first{same}. Beyond an arm of "
        f"{number(joint.moment / joint.force)} the moment is first: at the end of an arm of "
        f"{plain(_ARM)} a load of {plain(lever)} breaks the joint at its root, at twice the arm "
        "half of that. What has broken stays broken."
    )
    if any(module.grabs for module in modules):
        far = JOINT_STRENGTH[JointKind.FAR_JOINT]
        yield (
            "A module whose data say that its far end joins is also joined to a block of the frame "
            f"that its far end lies flush on, up to {plain(far.force)} and {plain(far.moment)}."
        )
    if _links(modules, "rope"):
        yield f"A winch's rope gives way at {plain(constants.ROPE_STRENGTH)}."


def _sharing(modules: Collection[Module]) -> Iterator[str]:
    yield (
        "Joints that bear a load together share it by their stiffness, as beams of a frame do; "
        f"loads are smoothed over {plain(constants.LOAD_FILTER_S)} s, so short blows count less."
        f" A cargo that lands counts over {plain(constants.BLOW_FILTER_S)} s, and bounces off with "
        f"{plain(constants.CARGO_BOUNCE)} / (1 + mass of the machine / "
        f"{plain(constants.BOUNCE_MASS)}) of its speed beyond {plain(constants.MIN_LANDING_SPEED)}."
    )
    if any(module.kind == "connector" for module in modules):
        yield (
            "Connectors that leave one face in one direction have the strength of one between "
            "them; at other faces or across each has its own."
        )
    if any(module.joint or module.motor for module in modules):
        yield (
            "A brace between the two sides of a joint that moves locks it, as does a second joint "
            "that closes a loop about another axis. Parts that are joined to each other pass "
            "through each other as they move."
        )
    if any(module.gear for module in modules):
        angle = math.degrees(math.acos(MESH_COSINE))
        yield (
            f"Gear wheels mesh when their axes are parallel (within {number(angle, 0)}°), as far "
            f"apart as the sum of their pitch radii (within {plain(MESH_SLACK)}), their discs "
            "overlap along the axis, and both turn on the same rigid part; speeds are inverse to "
            "the pitch radii, torques in proportion."
        )
    if any(module.wing or module.push or module.lift for module in modules):
        yield (
            f"Air figures give forces in mass·units/s²; divided by {plain(constants.GRAVITY)} they "
            "are in the unit above."
        )
    yield f"A block shifted more than {plain(JOINT_REACH)} off its face is not joined there."


def _links(modules: Collection[Module], link: str) -> bool:
    return any(module.kind == "connector" and module.link == link for module in modules)
