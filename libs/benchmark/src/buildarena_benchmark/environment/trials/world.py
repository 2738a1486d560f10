"""The world that machines are tried in, in a paragraph made from the simulators' constants."""

import math
from collections.abc import Collection, Iterator

from buildarena_benchmark import Task
from buildarena_geometry import Catalogue, Module
from buildarena_geometry.feedback.data_sheets import FRAME
from buildarena_geometry.feedback.words import number, plain
from buildarena_geometry.modules.joints import MESH_COSINE, MESH_SLACK
from buildarena_simulation import constants
from buildarena_simulation.constants import JOINT_STRENGTH, JointKind

_ARM = 4.0
"""Length of the lever that the paragraph reckons through, units."""


def world_text(catalogue: Catalogue, names: Collection[str], task: Task | None = None) -> str:
    """Return the meaning of modules' numbers and what breaks, for these modules."""
    modules = [catalogue.start, *(catalogue[name] for name in names)]
    has_cargo = task is None or task.scenario.cargo is not None
    texts = [units_text(catalogue, task), *_strengths(modules), *_sharing(modules)]
    return " ".join([*texts, *(_landing() if has_cargo else ())])


def units_text(catalogue: Catalogue, task: Task | None = None) -> str:
    """Return the meaning of modules' numbers: gravity, units of forces, friction, drag, places."""
    return " ".join([*_forces(task), *_units(catalogue.start)])


def _forces(task: Task | None) -> Iterator[str]:
    """Describe gravity and the unit of forces; hidden numbers are only mentioned."""
    gravity = plain(constants.GRAVITY)
    hidden_parameters = None if task is None else task.hidden_parameters
    if task is not None and task.scenario.planet is not None:
        origin = "Gravity and air are the planet's, as the task states."
    elif hidden_parameters is not None and hidden_parameters.gravity is not None:
        origin = "Gravity is hidden."
    else:
        origin = ""
    if origin:
        yield (
            f"{origin} A force of 1 accelerates a mass of 1 by {gravity} units/s²; moments are "
            "such forces times units."
        )
    else:
        yield (
            f"Gravity is {gravity} units/s². A force of 1 is the weight of a mass of 1; a "
            "moment is a force times units."
        )
    if hidden_parameters is not None and hidden_parameters.drive_strength is not None:
        yield "The strength of drives relative to their data is hidden."


def _units(start: Module) -> Iterator[str]:
    physics = start.physics
    if physics is not None:
        yield (
            f"Unless stated otherwise a module has friction {plain(physics.friction)} and loses "
            f"{plain(physics.linear_drag)} of its velocity per second to the air (drag)."
        )
    yield FRAME


def _strengths(modules: Collection[Module]) -> Iterator[str]:
    joint = JOINT_STRENGTH[JointKind.ATTACHMENT]
    turning = {
        module.physics.joint_type for module in modules if module.physics and module.joint
    } | {"axle" for module in modules if module.motor}
    same = [
        *(["braces"] if _links(modules, "rigid") else []),
        *(["moving joints"] if turning else []),
    ]
    like = f" So do {' and '.join(same)}." if same else ""
    yield (
        f"A joint breaks at a force of {plain(joint.force)} or a moment of {plain(joint.moment)}, "
        f"for good.{like} At the end of an arm of {plain(_ARM)} a load of "
        f"{plain(joint.moment / _ARM)} breaks the joint at its root."
    )
    if any(module.grabs for module in modules):
        far_joint = JOINT_STRENGTH[JointKind.FAR_JOINT]
        yield (
            '"Far end joins": it also joins a frame block that its far end lies flush on, up to '
            f"{plain(far_joint.force)} and {plain(far_joint.moment)}."
        )
    if _links(modules, "rope"):
        yield f"A rope breaks at {plain(constants.ROPE_STRENGTH)} and does not stretch."


def _sharing(modules: Collection[Module]) -> Iterator[str]:
    axial, shear, _, torsion, bending, _ = constants.JOINT_STIFFNESS
    brace = ""
    if _links(modules, "rigid"):
        brace = f"; of a brace of length L: axial {plain(constants.BRACE_STIFFNESS)} / L"
    yield (
        "Joints share loads by stiffness, as in a frame of beams. Relative stiffness of a joint: "
        f"axial {plain(axial)}, shear {plain(shear)}, torsion {plain(torsion)}, bending "
        f"{plain(bending)}{brace}. Loads are averaged over {plain(constants.LOAD_FILTER_S)} s."
    )
    if any(module.kind == "connector" for module in modules):
        yield (
            "Several connectors on one face in one direction are together only as strong as one."
        )
    if any(module.joint or module.motor for module in modules):
        yield (
            "A brace between the two sides of a moving joint locks it, as does a second joint that "
            "closes a loop about another axis. Connected parts pass through each other."
        )
    if any(module.gear for module in modules):
        angle = math.degrees(math.acos(MESH_COSINE))
        yield (
            f"Gear wheels mesh if their axes are parallel (within {number(angle, 0)}°) and the sum "
            f"of their radii apart (within {plain(MESH_SLACK)}), their discs overlap along the "
            "axis, and both turn on the same rigid part. Speeds are inverse to the radii, torques "
            "proportional."
        )
    if any(module.wing or module.push or module.lift for module in modules):
        yield f"Divide forces in mass·units/s² by {plain(constants.GRAVITY)} for the unit above."


def _landing() -> Iterator[str]:
    """Return how a cargo that lands loads a machine and bounces off."""
    yield (
        f"A landing cargo's load is averaged over {plain(constants.BLOW_FILTER_S)} s; it rebounds "
        f"with {plain(constants.CARGO_BOUNCE)} / (1 + machine's mass / "
        f"{plain(constants.BOUNCE_MASS)}) of its speed above {plain(constants.MIN_LANDING_SPEED)}."
    )


def _links(modules: Collection[Module], link: str) -> bool:
    return any(module.kind == "connector" and module.link == link for module in modules)
