"""Starts the stand-in game: `python -m support.game.stand_in_game --machines DIR --games FILE`."""

import argparse
import ctypes
import sys
from pathlib import Path

from support.game.stand_in_game.faults import Faults
from support.game.stand_in_game.game import Game
from support.game.stand_in_game.window import Report, Window

_PR_SET_NAME = 15


def main() -> int:
    """Starts the game with the options of the command line."""
    options = _parser().parse_args()
    faults = Faults(options.faults_once)
    if options.faults_once is not None:
        options.faults_once.unlink(missing_ok=True)
    game = Game(options.games, faults, options.speed, options.level)
    # The process is called as the game's, by which the runner knows it.
    ctypes.CDLL(None).prctl(_PR_SET_NAME, b"Besiege", 0, 0, 0)
    Window(game, options.machines, Report(options.report), title=options.title_screen).run()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stand_in_game", description=__doc__)
    add = parser.add_argument
    add("--machines", type=Path, default=Path(), metavar="DIR", help="the SavedMachines folder")
    add("--games", type=Path, required=True, metavar="FILE", help="the golden logs, a ZIP file")
    add("--level", metavar="FILE", help="a level (.blv); else the flat sandbox")
    add("--title-screen", action="store_true", help="begin there: two clicks lead to the level")
    add("--speed", type=float, default=1.0, help="game time over the wall clock")
    add("--faults-once", type=Path, metavar="FILE", help="faults of this start; then deleted")
    add("--report", type=Path, metavar="FILE", help="kept up to date with what the game does")
    return parser


if __name__ == "__main__":
    sys.exit(main())
