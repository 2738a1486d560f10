"""Interpretation of a controller's answers: levels by names of actions, of all blocks or of one."""

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from buildarena_simulation.control import Bindings, channel
from buildarena_simulation.errors import ControllerFailed

if TYPE_CHECKING:
    from buildarena_simulation.structure.model import Structure

_NEAR: Final = 3


class Channels:
    """Names that a machine's controller may answer.

    Args:
        bindings: Actions of each part, the blocks and then the springs.
        ids: (N + K,) their ids.

    Attributes:
        names: Name of each action of each part, see `channel`.
        named: Actions of parts by name.
        opposites: Opposite of each action that has one.
    """

    def __init__(self, structure: "Structure", bindings: Bindings, ids: Sequence[str]) -> None:
        self.opposites = _opposites(structure)
        self._switches = _switches(structure)
        self.named: dict[str, list[tuple[int, str]]] = {}
        self.names: dict[tuple[int, str], str] = {}
        for part, actions in enumerate(bindings):
            for action in actions:
                self.named.setdefault(action, []).append((part, action))
                self.names[part, action] = channel(ids[part], action)
        self.named.update((name, [key]) for key, name in self.names.items())

    def axes(self) -> dict[str, float]:
        """Return the minimum of each action: -1 for the first of two opposites, otherwise 0."""
        axes: dict[str, float] = {}
        for (part, action), name in self.names.items():
            opposite = self.opposites.get((part, action))
            if opposite is None:
                axes[name] = 0.0
            elif self.names.get((part, opposite)) not in axes:
                axes[name] = -1.0
        return axes

    def levels(self, answers: Mapping[str, float]) -> dict[tuple[int, str], float]:
        """Return the level of each action of each part, 0 to 1; missing ones are 0.

        The name of one block overrides the name of all. Below 0 an action is its opposite.

        Args:
            answers: Program's answers, clipped to -1 to 1.

        Raises:
            ControllerFailed: A name is unknown; the message lists similar ones.
        """
        if not answers.keys() <= self.named.keys():
            raise self._unknown(min(answers.keys() - self.named.keys()))
        asked: dict[tuple[int, str], float] = {}
        for is_of_one in (False, True):
            for name, number in answers.items():
                if ("." in name) is is_of_one:
                    asked.update(dict.fromkeys(self.named[name], min(max(number, -1.0), 1.0)))
        levels: dict[tuple[int, str], float] = {}
        for (part, action), share in asked.items():
            target = action if share >= 0 else self.opposites.get((part, action))
            if target is not None:
                levels[part, target] = max(abs(share), levels.get((part, target), 0.0))
        return levels

    def takes_share(self, part: int, action: str) -> bool:
        """Check if an action may have a fractional level; others are on above a half."""
        return (part, action) not in self._switches

    def _unknown(self, name: str) -> ControllerFailed:
        similar = near_names(name, self.named)
        names = similar or sorted({action for _, action in self.names})
        shown = ", ".join(names) or "none: no block of this machine has an action"
        return ControllerFailed(f"there is no action {name[:60]!r}; there is {shown}")


def near_names(name: str, names: Iterable[str]) -> list[str]:
    """Return at most three names similar to a name, the nearest first."""
    return difflib.get_close_matches(name, list(names), n=_NEAR, cutoff=0.4)


def _switches(structure: "Structure") -> set[tuple[int, str]]:
    """Return the actions that are only on or off."""
    switches = {
        (len(structure) + k, spring.contract)
        for k, spring in enumerate(structure.ropes.spring_of)
        if spring.contract is not None
    }
    for index, part in enumerate(structure.parts):
        if part.module.brake is not None:
            switches |= {(index, action) for action in part.module.brake.actions}
        if part.module.decouple is not None:
            switches.add((index, part.module.decouple.action))
        if part.module.grip is not None:
            switches |= {(index, part.module.grip.grab), (index, part.module.grip.release)}
    return switches


def _opposites(structure: "Structure") -> dict[tuple[int, str], str]:
    """Return the opposite of each action that has one."""
    opposites: dict[tuple[int, str], str] = {}
    for index, part in enumerate(structure.parts):
        module = part.module
        drive = module.joint.drive if module.joint else None
        pairs = [
            (module.motor.forward, module.motor.backward) if module.motor else None,
            (drive.forward, drive.backward) if drive else None,
            (module.altitude.rise, module.altitude.sink) if module.altitude else None,
            (module.push.action, module.push.reverse) if module.push else None,
            (module.flywheel.left, module.flywheel.right) if module.flywheel else None,
        ]
        for forward, backward in filter(None, pairs):
            if forward is not None and backward is not None:
                opposites[index, forward], opposites[index, backward] = backward, forward
    return opposites
