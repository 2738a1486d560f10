"""``python -m buildarena_simworker.besiege COMMAND``: this machine's game."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from buildarena_simworker.besiege.calibrate import (
    Asker,
    opened_terrain,
    printing_run,
    record_findings,
    try_out,
)
from buildarena_simworker.besiege.doctor import examine
from buildarena_simworker.besiege.errors import DesktopError, NotSetUpError
from buildarena_simworker.besiege.installed import installed
from buildarena_simworker.besiege.screen.calibration import Calibration, load_calibration
from buildarena_simworker.besiege.screen.input import ScreenInput
from buildarena_simworker.besiege.screen.window import make_desktop, open_windows
from buildarena_simworker.besiege.settings import BesiegeSettings


def main() -> None:
    """Calibrate or check this machine's game."""
    parser = argparse.ArgumentParser(prog="buildarena besiege", description=main.__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    calibrate = commands.add_parser("calibrate", help="find out where to click, and try it")
    calibrate.add_argument(
        "--defaults", action="store_true", help="take the published runner's positions, ask nothing"
    )
    calibrate.add_argument(
        "--try", dest="only_try", action="store_true", help="only try the calibration that is there"
    )
    calibrate.add_argument(
        "--path", action="store_true", help="record the clicks from the game's title to its level"
    )
    doctor = commands.add_parser("doctor", help="what this machine lacks to play the game")
    doctor.add_argument("--json", action="store_true", help="print the findings as JSON")
    options = parser.parse_args()
    settings = BesiegeSettings()
    try:
        if options.command == "doctor":
            sys.exit(_doctor(settings, as_json=options.json))
        sys.exit(
            _calibrate(
                settings, ask=not options.defaults, only_try=options.only_try, path=options.path
            )
        )
    except (NotSetUpError, DesktopError) as error:
        sys.exit(f"error: {error}")


def _doctor(settings: BesiegeSettings, *, as_json: bool) -> int:
    findings = list(examine(settings))
    if as_json:
        _say(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        for finding in findings:
            advice = f" - {finding.advice}" if finding.advice else ""
            _say(f"{'ok' if finding.ok else '!!'}  {finding.name}: {finding.detail}{advice}")
    return 0 if all(finding.ok for finding in findings) else 1


def _calibrate(settings: BesiegeSettings, *, ask: bool, only_try: bool, path: bool) -> int:
    file = settings.calibration_file
    calibration = load_calibration(file) if file.exists() else Calibration()
    if ask and not only_try:
        asker = _asker(settings)
        calibration = asker.path(calibration) if path else asker.positions(calibration)
    if not only_try:
        _save(calibration, settings)
    if path:
        return 0
    _say("Trying it: hands off mouse and keyboard.")
    if ask and not only_try:
        _point_at_log(settings, calibration)
    return _try(settings)


def _point_at_log(settings: BesiegeSettings, calibration: Calibration) -> None:
    """Calibrate the log's position while a machine prints; before, there is no log to point at."""
    desktop, _ = make_desktop(settings)
    try:
        desktop.print_lines(printing_run(opened_terrain(settings)))
        _save(_asker(settings).log(calibration), settings)
        desktop.stop()
        desktop.clear()
    finally:
        desktop.close()


def _try(settings: BesiegeSettings) -> int:
    desktop, _ = make_desktop(settings)
    try:
        played = try_out(desktop, settings.time_limits, _say, opened_terrain(settings))
        if played is None:
            return 1
        before = load_calibration(settings.calibration_file)
        present = installed(settings.folder)
        _save(record_findings(before, played, open_windows(settings), present), settings)
    finally:
        desktop.close()
    return 0


def _asker(settings: BesiegeSettings) -> Asker:
    return Asker(
        screen_input=ScreenInput(settings.pace),
        windows=open_windows(settings),
        ask=input,
        show=_say,
    )


def _save(calibration: Calibration, settings: BesiegeSettings) -> None:
    calibration.save(settings.calibration_file)
    _say(f"saved {settings.calibration_file}, calibration {calibration.digest}")


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


main()
