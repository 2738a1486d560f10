"""Starts the stand-in game: `python -m stand_in_game --machines DIR`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from stand_in_game.faults import FaultError, Faults, random_faults, read_faults
from stand_in_game.game import Game, Settings
from stand_in_game.level_file import read_level_file
from stand_in_game.machine_file import GameFileError
from stand_in_game.report import Report


def main() -> int:
    """Starts the game with the options of the command line."""
    parser = _parser()
    options, unknown = parser.parse_known_args()
    if unknown and not options.headless:
        parser.error(f"unknown options: {' '.join(unknown)}")
    try:
        faults = read_faults(options.faults) if options.faults else []
        if options.faults_once is not None and options.faults_once.exists():
            faults += read_faults(options.faults_once)
            options.faults_once.unlink()
        if options.random_faults is not None:
            faults += random_faults(options.random_faults)
        terrain = read_level_file(options.level) if options.level else ()
    except (FaultError, GameFileError, ValueError, OSError) as error:
        sys.stderr.write(f"stand_in_game: {error}\n")
        return 2
    settings = Settings(
        terrain=terrain,
        speed=options.speed,
        log_lines=options.log_lines,
        horizon_s=options.horizon,
        seed=options.seed,
        log_file=options.log_file,
    )
    game = Game(settings, Faults(faults), scripted=not options.headless)
    return _show(game, options)


def _show(game: Game, options: argparse.Namespace) -> int:
    # Each imported where it is used: a headless game runs where there is no toolkit.
    if options.headless:
        from stand_in_game.headless import Headless

        return Headless(game, Report(options.report), ip=options.ip, port=options.port).run()
    from stand_in_game.window import Frame, Window

    frame = Frame(size=options.size, place=options.place, rate=options.frame_rate)
    Window(game, options.machines, Report(options.report), frame).run()
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="stand_in_game", description=__doc__)
    add = parser.add_argument
    add("--machines", type=_folder, default=Path(), metavar="DIR", help="the SavedMachines folder")
    add("--level", type=_optional, metavar="FILE", help="a level (.blv); else the flat sandbox")
    add("--speed", type=_positive, default=1.0, help="game time over the wall clock")
    add("--frame-rate", type=_positive, default=30.0, help="frames a second of the wall clock")
    add("--size", type=_pair("x"), default=(1280, 800), metavar="WxH", help="pixels")
    add("--place", type=_pair(","), default=(0, 0), metavar="X,Y", help="on the screen, pixels")
    add("--log-lines", type=int, default=400, help="how many lines the log window keeps")
    add("--horizon", type=_positive, default=36.0, help="seconds of a simulation worked out")
    add("--faults", type=Path, metavar="FILE", help="a JSON list of faults")
    add("--faults-once", type=Path, metavar="FILE", help="faults of this start; then deleted")
    add("--random-faults", type=int, metavar="SEED", help="some faults, drawn at random")
    add("--report", type=Path, metavar="FILE", help="kept up to date with what the game does")
    add("--log-file", type=Path, metavar="FILE", help="write the log there as well")
    add("--seed", type=int, default=0, help="draws everything random")
    add("--headless", action="store_true", help="no window: the protocol of BesiegeField")
    add("--ip", default="127.0.0.1", help="headless: where it listens")
    add("--port", type=int, default=6890, help="headless: where it listens; 0 for a free one")
    return parser


def _optional(text: str) -> Path | None:
    return Path(text) if text else None


def _folder(text: str) -> Path:
    path = Path(text)
    if not path.is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder {text}")
    return path


def _positive(text: str) -> float:
    number = float(text)
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"a number above 0, not {text}")
    return number


class _pair:  # noqa: N801 - argparse shows the name of a type
    """Reads two whole numbers with a sign between them."""

    def __init__(self, sign: str) -> None:
        self._sign = sign

    def __call__(self, text: str) -> tuple[int, int]:
        first, sign, second = text.partition(self._sign)
        if not sign:
            raise argparse.ArgumentTypeError(f"two numbers with {self._sign!r} between, not {text}")
        return int(first), int(second)


if __name__ == "__main__":
    sys.exit(main())
