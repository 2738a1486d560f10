"""Light bridges over a gap of ten, and machines that carry otherwise than a bridge does."""

from collections.abc import Iterable, Sequence

from support.machines.drafts import KeyedDraft
from support.machines.people.bridges import Frame

from buildarena_geometry import Machine
from buildarena_worker.builtin.designs.drafting import DOWN, NORTH, SOUTH, UP, Direction

Braces = Sequence[tuple[int, int, Direction]]
"""From and to which block of the row, northwards of its middle, and on which side."""


def row(
    half: int = 5, *, columns: Iterable[int] = (), height: int = 5, braces: Braces = ()
) -> Frame:
    """A row of blocks, with columns that hang from it, and braces along it."""
    cells = [(0, y, 0) for y in range(-half, half + 1)]
    cells += [(0, y, -z) for y in columns for z in range(1, height + 1)]
    frame = Frame(cells)
    for first, second, way in braces:
        frame.brace((0, first, 0), (0, second, 0), way)
    return frame


def hanging_post(height: int, half: int = 5) -> Machine:
    """A row with a post below its middle, from whose foot braces go to its ends."""
    frame = row(half, columns=(0,), height=height)
    frame.brace((0, 0, -height), (0, -half, 0), SOUTH, DOWN)
    frame.brace((0, 0, -height), (0, half, 0), NORTH, DOWN)
    return frame.machine


def three_pieces(height: int, half: int = 5) -> Machine:
    """A post over the gap and a piece on each terrain, four long braces between them."""
    post, end = KeyedDraft(), KeyedDraft()
    post.row(post.start(), DOWN, height)
    end.attach(end.start(), SOUTH)
    whole = KeyedDraft({"post": post.machine, "end": end.machine})
    whole.do("add_machine", machine_id="post")
    whole.do("add_machine", machine_id="end", init_shift=[0, 1 - half, 0])
    whole.do("add_machine", machine_id="end", init_shift=[0, half, 0])
    for inner, toward, back in (("B_1", SOUTH, NORTH), ("C_2", NORTH, SOUTH)):
        whole.connect("A_1", inner, toward, back)
        whole.connect(f"A_{1 + height}", inner, toward, DOWN)
    return whole.machine


def with_ballast() -> Machine:
    """A braced row with a mast at each end, beyond the gap: mass that carries nothing."""
    half = 7
    cells = [(0, y, 0) for y in range(-half, half + 1)]
    cells += [(0, y, z) for y in (-half, half) for z in range(1, 5)]
    frame = Frame(cells)
    for first in (-4, -2, 0):
        for way in (UP, DOWN):
            frame.brace((0, first, 0), (0, first + 4, 0), way)
    return frame.machine
