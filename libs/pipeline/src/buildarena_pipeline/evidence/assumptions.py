"""What is assumed of the game and not known: one table, for the document and for the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumption:
    """Something that is taken for true until somebody has looked.

    Attributes:
        name: What records call it.
        text: What is assumed, in one sentence or two.
        expected: What must be seen, if it is true.
    """

    name: str
    text: str
    expected: str


_TABLE: Final = (
    Assumption(
        name="versions",
        text="Game and mod are those that the settings name, as their files say.",
        expected="every point of the examination is in order",
    ),
    Assumption(
        name="places",
        text="The buttons are where the calibration has them, and every click has its effect.",
        expected="two blocks are loaded, started, read to the end and deleted",
    ),
    Assumption(
        name="entries",
        text="The names and kinds of entries in machine files are the game's own.",
        expected="the game saves every entry that was sent, with its value",
    ),
    Assumption(
        name="modules",
        text="The game loads every module type by its number.",
        expected="the game saves as many blocks of each type as were sent",
    ),
    Assumption(
        name="roots",
        text="Positions are those of blocks' roots. The root of starting blocks and wheels is the "
        "centre; that of other blocks is half a block aside, that of the cargo half its height "
        "below.",
        expected="the first sample has every block within 0.25 of its root in the file, seen from "
        "the starting block",
    ),
    Assumption(
        name="gravity",
        text="Gravity is 32.81 units/s².",
        expected="the game reports it within 0.5 %",
    ),
    Assumption(
        name="floor",
        text="Below an empty level there is a floor at height 0.",
        expected="every ray beside a machine in the sandbox ends within 0.25 of 0",
    ),
    Assumption(
        name="level_origin",
        text="The origin of a level's box is the middle of its underside.",
        expected="rays end on terrain within 0.1 of the height in the level's file",
    ),
    Assumption(
        name="colliders",
        text="Blocks are as large as the module file says.",
        expected="a dropped cross rests with its roots within 0.1 of half a block above the floor",
    ),
    Assumption(
        name="masses",
        text="Blocks have the masses of the module file.",
        expected="on two balances a log (1.0) outweighs three small wooden blocks (0.9), and four "
        "(1.2) outweigh it",
    ),
    Assumption(
        name="mass_slider",
        text='`set_slider("mass", v)` takes effect at once, and scaling a cargo does not change '
        "its mass.",
        expected="a log that tells the mass of a body; the mod has no such function",
    ),
    Assumption(
        name="pace",
        text="The script's time passes as the wall clock's; its lag is not in the log, the runner "
        "measures it.",
        expected="a run lasts at most 1.1 times its own time",
    ),
    Assumption(
        name="copies",
        text="The log window is copied fast enough that no line is lost.",
        expected="no sample is missing, and two copies are less than 3 s apart",
    ),
    Assumption(
        name="landing",
        text="A machine that falls lands in the game when and where it does in our engines.",
        expected="first contact within 0.12 s and rest within 0.1 units of each engine",
    ),
    Assumption(
        name="wheels",
        text="Powered wheels drive a machine in the game as in our engines.",
        expected="the way after the trial within a tenth of each engine's",
    ),
    Assumption(
        name="program_text",
        text="The mod's Lua runs the text of a program, by `load` with an environment of its own, "
        "and calls it as ours does.",
        expected="a program does not fail, and its answers at every tick are those that it gives "
        "here to the same senses",
    ),
    Assumption(
        name="program_senses",
        text="What the mod tells of a block (`position`, `right`, `up`, `forward`) makes a "
        "program's senses.",
        expected="the position that a program is told is within 0.1 of the starting block's in the "
        "log, and on a machine that stands up points up (0.98)",
    ),
    Assumption(
        name="program_keys",
        text="Blocks heed keys of joysticks in machine files, which `new_key_emulator` presses "
        "though there is no joystick.",
        expected="two wheels that a program asks for turn by 0.5 rad/s or more",
    ),
    Assumption(
        name="program_shares",
        text="A key that is down in every second update drives a motor at half its speed.",
        expected="a wheel asked for a half turns at a half of the speed of one asked for all, "
        "within a tenth of it",
    ),
    Assumption(
        name="agreement",
        text="Our engines give a machine the verdict that the game gives it.",
        expected="the same verdict in every run of the expert's machine",
    ),
)

ASSUMPTIONS: Final[Mapping[str, Assumption]] = MappingProxyType(
    {assumption.name: assumption for assumption in _TABLE}
)
"""Every assumption, by name, in the order of documents."""


def assumptions_table() -> str:
    """The assumptions as a table of a document."""
    rows = [f"| `{row.name}` | {row.text} | {row.expected} |" for row in _TABLE]
    return "\n".join(["| name | assumed | expected |", "|---|---|---|", *rows])
