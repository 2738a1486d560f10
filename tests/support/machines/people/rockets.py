"""Rockets: rings of heated cannons round a column."""

from support.machines.drafts import KeyedDraft

from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import UP


def ring(cannons: int, *, nose: int = 0) -> Machine:
    """Cannons at even angles round a column that stands on its end, each over a torch.

    Cannons of one angle and its opposite share three levels of the column; each such group is
    twisted against the one below, so that the thrusts' sum goes through the axis.

    Args:
        cannons: How many, 3 or more.
        nose: Blocks on top.
    """
    draft = KeyedDraft()
    opposite = cannons % 2 == 0
    groups = cannons // 2 if opposite else cannons
    step_deg = (180.0 if opposite else 360.0) / groups
    low = draft.start()
    for group in range(groups):
        if group:
            low = draft.attach(low, UP)
            draft.do("twist_block", block_id=low, angle=step_deg)
        high = draft.row(low, UP, 2)[-1]
        for side in _sides(draft, high, both=opposite):
            draft.cannon(high, side, (0, 0, -1))
            draft.torch(low, side, UP)
        low = high
    draft.row(low, UP, nose)
    return draft.machine


def _sides(draft: KeyedDraft, block: str, *, both: bool) -> list[tuple[float, float, float]]:
    """The direction of one of a block's side faces, and of the opposite one."""
    base = draft.machine.blocks[block]
    normals = [base.face_normal(face.label) for face in base.module.faces]
    level = next(normal for normal in normals if abs(normal[2]) < 0.1)
    one = (float(level[0]), float(level[1]), float(level[2]))
    return [one, (-one[0], -one[1], -one[2])] if both else [one]
