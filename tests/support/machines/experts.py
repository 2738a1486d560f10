"""The expert's machines for tasks that are played by keys."""

from support.player import Player

from buildarena_geometry import Machine


def experts_machine(task: str) -> Machine:
    """What the expert builds, with its key presses."""
    asked = Player()("builtin/expert", task=task).suspended
    assert asked is not None
    document = asked.machine.to_document()
    if asked.controls is not None:
        document["control_sequence"] = [
            {"time_s": press.time_s, "key": press.key, "hold_for_s": press.hold_for_s}
            for press in asked.controls
        ]
    return Machine.from_document(document)
