"""Moving joints of a PyBullet multibody other than simple axles, and gears.

A constant-velocity joint is three hinges in a row with small links between them; the outer two are
geared together.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from buildarena_simulation.engines.base import World, quaternion_of, rotation_of
from buildarena_simulation.engines.pybullet.quiet_output import quiet_output
from buildarena_simulation.engines.shared.joint_frames import (
    driven_clusters,
    engaged,
    entered_place,
    joint_type_of,
    sign_of,
)
from buildarena_simulation.structure.clusters import Clusters
from buildarena_simulation.structure.model import FloatArray, Structure
from buildarena_simulation.structure.motion import Motion

with quiet_output():
    import pybullet

_SERVO_TIME_S: Final = 0.02
"""Time constant with which a drive reaches its set point, seconds."""

_TEETH: Final = 1e6
"""Greatest force between teeth, and of a spring, mass·unit/s²: more than occurs."""

_TOOTH_ERP: Final = 0.8
"""Share of a gear's error that a step removes."""

_NO_TURN: Final = (0.0, 0.0, 0.0, 1.0)
_NONE: Final = (0.0, 0.0, 0.0)


@dataclass(slots=True, kw_only=True)
class _Drive:
    """A driven link.

    Attributes:
        link: The engine's link.
        sign: -1 if the moved link is the base's instead of the attached block's.
        force: Maximum, mass·unit/s², times units if it turns.
        holds_place: True if its target is a position, false if it is a speed.
        commanded: Its last target; infinite before the first.
    """

    link: int
    sign: float
    force: float
    holds_place: bool
    commanded: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Articulation:
    """Multibody with joints of any kind.

    Attributes:
        axes: (C, 3, 3) machine_from_principal.
        body: Id of the body in the engine.
        links: Link of each cluster inside, -1 for the root.
        chains: Links from each cluster's parent to the cluster: its own, and before it those
            between the hinges of a constant-velocity joint.
        client: The engine's world.
        time_step_s: Length of a step, seconds.
    """

    world: World
    clusters: Clusters
    axes: FloatArray
    body: int
    links: Mapping[int, int]
    chains: Mapping[int, tuple[int, ...]]
    client: Mapping[str, int]
    time_step_s: float
    _drives: dict[int, _Drive] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """The machine."""
        return self.world.structure

    def start(self, motion: Motion, targets: FloatArray | None) -> None:
        """Set all joints to their clusters' positions, and add springs and friction.

        Args:
            targets: (D,) last targets of the driven joints; None at the start.
        """
        self._find_drives()
        for c, link in self._joints():
            joint_type = joint_type_of(self.structure, self.clusters, c)
            entered = entered_place(self.structure, self.clusters, motion, c, targets)
            if joint_type == "ball":
                self._start_ball(c, link, entered.place, entered.rate)
            elif joint_type == "constant_velocity":
                for at, place, rate in zip(
                    self.chains[c], entered.place, entered.rate, strict=True
                ):
                    self._reset(at, place, rate)
                    self._motor(at, pybullet.VELOCITY_CONTROL, force=0.0)
                self._tie(self.chains[c][0], link, 1.0)
            else:
                self._reset(link, entered.place[0], entered.rate[0])
                self._rest(c, link)

    def follow(self, targets: FloatArray) -> None:
        """Set the targets of the drives that changed.

        Args:
            targets: (D,) as in `Schedule.targets`.
        """
        commands = targets.tolist()
        for d, drive in self._drives.items():
            target = commands[d]
            if target == drive.commanded:
                continue
            drive.commanded = target
            if drive.holds_place:
                self._motor(
                    drive.link,
                    pybullet.POSITION_CONTROL,
                    targetPosition=drive.sign * target,
                    positionGain=self.time_step_s / _SERVO_TIME_S,
                    velocityGain=1.0,
                    force=drive.force,
                )
            else:
                free = math.isnan(target)
                self._motor(
                    drive.link,
                    pybullet.VELOCITY_CONTROL,
                    targetVelocity=0.0 if free else drive.sign * target,
                    force=0.0 if free else drive.force,
                )

    def read(self, motion: Motion) -> None:
        """Compute the motion of the clusters that have parents."""
        inside = [(c, link) for c, link in self._joints()]
        states = pybullet.getLinkStates(
            self.body,
            [link for _, link in inside],
            computeLinkVelocity=1,
            computeForwardKinematics=1,
            **self.client,
        )
        for (c, _), state in zip(inside, states, strict=True):
            turn = rotation_of(np.array(state[1])[[3, 0, 1, 2]])
            motion.rotation[c] = turn @ self.axes[c].T
            center = motion.rotation[c] @ self.clusters.center_of_mass[c]
            motion.position[c] = state[0] - center
            motion.velocity[c], motion.spin[c] = state[6], state[7]

    def release(self) -> None:
        """Remove the springs, which PyBullet would otherwise give to the next body of this id."""
        for c, link in self._joints():
            joint = self.structure.parts[self.clusters.attached[c]].module.joint
            if joint is not None and (joint.stiffness or joint.damping):
                self._spring(link, 0.0, 0.0)

    def _find_drives(self) -> None:
        place = {int(block): d for d, block in enumerate(self.structure.joints.driven)}
        inside = [c for c in driven_clusters(self.structure, self.clusters) if c in self.links]
        for c in inside:
            block = int(self.clusters.attached[c])
            module = self.structure.parts[block].module
            drive = None if module.joint is None else module.joint.drive
            limit = self.structure.torques[block] if drive is None else drive.force
            self._drives[place[block]] = _Drive(
                link=self.links[c],
                sign=sign_of(self.clusters, c),
                force=float(limit) * self.world.drive_unit,
                holds_place=drive is not None and drive.kind == "position",
            )

    def _joints(self) -> Iterator[tuple[int, int]]:
        return ((c, link) for c, link in self.links.items() if link >= 0)

    def _rest(self, c: int, link: int) -> None:
        """Return friction, or spring and damper, of a joint with one coordinate."""
        joint = self.structure.parts[self.clusters.attached[c]].module.joint
        friction = 0.0 if joint is None else joint.friction * self.world.force_unit
        self._motor(link, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=friction)
        if joint is not None and (joint.stiffness or joint.damping):
            self._spring(
                link, joint.stiffness * self.world.force_unit, joint.damping * self.world.force_unit
            )

    def _spring(self, link: int, stiffness: float, damping: float) -> None:
        self._motor(
            link,
            pybullet.PD_CONTROL,
            targetPosition=0.0,
            targetVelocity=0.0,
            positionGain=stiffness,
            velocityGain=damping,
            force=_TEETH,
        )

    def _start_ball(self, c: int, link: int, place: FloatArray, rate: FloatArray) -> None:
        joint = self.structure.parts[self.clusters.attached[c]].module.joint
        friction = 0.0 if joint is None else joint.friction * self.world.force_unit
        turn = quaternion_of(self.axes[c].T @ rotation_of(place) @ self.axes[c])
        pybullet.resetJointStateMultiDof(
            self.body,
            link,
            turn[[1, 2, 3, 0]].tolist(),
            (self.axes[c].T @ rate).tolist(),
            **self.client,
        )
        pybullet.setJointMotorControlMultiDof(
            self.body,
            link,
            pybullet.POSITION_CONTROL,
            targetPosition=_NO_TURN,
            targetVelocity=_NONE,
            positionGain=0.0,
            velocityGain=1.0,
            force=[friction] * 3,
            **self.client,
        )

    def _reset(self, link: int, place: float, rate: float) -> None:
        pybullet.resetJointState(self.body, link, float(place), float(rate), **self.client)

    def _motor(self, link: int, mode: int, **parameters: Any) -> None:
        pybullet.setJointMotorControl2(self.body, link, mode, **parameters, **self.client)

    def add_gears(self) -> None:
        """Couple the cogs that mesh."""
        for first, second, ratio in engaged(self.structure, self.clusters):
            if first in self.links and second in self.links:
                self._tie(self.links[first], self.links[second], ratio)

    def _tie(self, link: int, other: int, ratio: float) -> None:
        """Couple the second link's rate to a multiple of the first's, while the body exists."""
        body, client = self.body, self.client
        gear = pybullet.createConstraint(
            body, link, body, other, pybullet.JOINT_GEAR, (0, 0, 1), _NONE, _NONE, **client
        )
        # PyBullet's ratio is that of the first to the second: first + ratio x second = 0.
        pybullet.changeConstraint(
            gear,
            gearRatio=-1.0 / ratio,
            maxForce=_TEETH,
            erp=_TOOTH_ERP,
            relativePositionTarget=0.0,
            **client,
        )


def articulated(
    world: World,
    clusters: Clusters,
    axes: FloatArray,
    *,
    body: int,
    inside: Sequence[int],
    time_step_s: float,
    client: Mapping[str, int],
) -> Articulation:
    """Return the joints of a multibody that was loaded.

    Args:
        axes: (C, 3, 3) machine_from_principal.
        body: Id of the body in the engine.
        inside: Its clusters, the root first.
        time_step_s: Length of a step, seconds.
        client: The engine's world.
    """
    names = [
        pybullet.getJointInfo(body, link, **client)[12].decode()
        for link in range(pybullet.getNumJoints(body, **client))
    ]
    place = {name: link for link, name in enumerate(names)}
    links = {c: place[f"link {k}"] if k else -1 for k, c in enumerate(inside)}
    chains = {}
    for k, c in enumerate(inside):
        own, between = f"link {k}", [f"link {k} between {n}" for n in (0, 1)]
        chain = [*between, own] if between[0] in place else [own]
        if k:
            chains[c] = tuple(place[name] for name in chain)
    return Articulation(
        world=world,
        clusters=clusters,
        axes=axes,
        body=body,
        links=links,
        chains=chains,
        client=client,
        time_step_s=time_step_s,
    )
