"""What a controller asks for: names of actions, of all blocks or of one, and how far."""

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from buildarena_simulation.control import Bindings, channel
from buildarena_simulation.errors import ControllerFailed

if TYPE_CHECKING:
    from buildarena_simulation.structure.model import Structure

_NEAR: Final = 3


class Channels:
    """The names that a machine's controller may answer.

    Args:
        structure: The machine.
        bindings: The actions of each part, the blocks and then the springs.
        ids: (N + K,) their ids.

    Attributes:
        names: What each action of each part is called, see `channel`.
        named: The actions of parts that each name is for.
        opposites: The action that does the opposite of another, for those that have one.
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
        """The least number for each action: -1 for the first of two opposites, otherwise 0."""
        axes: dict[str, float] = {}
        for (part, action), name in self.names.items():
            opposite = self.opposites.get((part, action))
            if opposite is None:
                axes[name] = 0.0
            elif self.names.get((part, opposite)) not in axes:
                axes[name] = -1.0
        return axes

    def levels(self, answers: Mapping[str, float]) -> dict[tuple[int, str], float]:
        """How far each action of each part is asked for, 0 to 1; what is missing is not.

        A name of one block counts in place of the name of all. Below 0 an action is its opposite.

        Args:
            answers: What the program answered; beyond -1 and 1 it counts as those.

        Raises:
            ControllerFailed: There is no such name; the message has those that are near.
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
            wanted = action if share >= 0 else self.opposites.get((part, action))
            if wanted is not None:
                levels[part, wanted] = max(abs(share), levels.get((part, wanted), 0.0))
        return levels

    def takes_share(self, part: int, action: str) -> bool:
        """Whether an action may be asked for in part; others are on above a half."""
        return (part, action) not in self._switches

    def _unknown(self, name: str) -> ControllerFailed:
        near = near_names(name, self.named)
        names = near or sorted({action for _, action in self.names})
        shown = ", ".join(names) or "none: no block of this machine has an action"
        return ControllerFailed(f"there is no action {name[:60]!r}; there is {shown}")


def near_names(name: str, names: Iterable[str]) -> list[str]:
    """Those of some names that somebody may have meant, the nearest first; at most three."""
    return difflib.get_close_matches(name, list(names), n=_NEAR, cutoff=0.4)


def _switches(structure: "Structure") -> set[tuple[int, str]]:
    """The actions that are only on or off."""
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
    """The action that does the opposite of another, for those that have one."""
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
