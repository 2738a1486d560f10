"""``python -m buildarena_simworker_besiege calibrate|doctor``: this machine's game."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from buildarena_simworker_besiege.doctor import examine
from buildarena_simworker_besiege.errors import DesktopError, NotSetUpError
from buildarena_simworker_besiege.screen.calibration import Calibration, load_calibration
from buildarena_simworker_besiege.set_up import make_desktop
from buildarena_simworker_besiege.settings import BesiegeSettings


def main() -> None:
    """Calibrates or examines this machine's game."""
    parser = argparse.ArgumentParser(prog="buildarena besiege", description=main.__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    calibrate = commands.add_parser("calibrate", help="find out where to click, and try it")
    calibrate.add_argument(
        "--defaults", action="store_true", help="take the published runner's positions, ask nothing"
    )
    calibrate.add_argument(
        "--try", dest="only_try", action="store_true", help="only try the calibration that is there"
    )
    doctor = commands.add_parser("doctor", help="what this machine lacks to play the game")
    doctor.add_argument("--json", action="store_true", help="print the findings as JSON")
    options = parser.parse_args()
    settings = BesiegeSettings()
    try:
        if options.command == "doctor":
            sys.exit(_doctor(settings, as_json=options.json))
        sys.exit(_calibrate(settings, ask=not options.defaults, only_try=options.only_try))
    except (NotSetUpError, DesktopError) as error:
        sys.exit(f"error: {error}")


def _doctor(settings: BesiegeSettings, *, as_json: bool) -> int:
    findings = examine(settings)
    if as_json:
        _say(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        for finding in findings:
            advice = f" - {finding.advice}" if finding.advice else ""
            _say(f"{'ok' if finding.ok else '!!'}  {finding.name}: {finding.detail}{advice}")
    return 0 if all(finding.ok for finding in findings) else 1


def _calibrate(settings: BesiegeSettings, *, ask: bool, only_try: bool) -> int:
    from buildarena_simworker_besiege.calibrate import ask_positions, try_out
    from buildarena_simworker_besiege.screen.input import ScreenInput
    from buildarena_simworker_besiege.screen.windows import open_windows

    file = settings.calibration_file
    if not only_try:
        before = load_calibration(file) if file.exists() else Calibration()
        calibration = before
        if ask:
            screen_input, windows = ScreenInput(settings.pace), open_windows()
            calibration = ask_positions(
                screen_input, windows, settings.title, ask=input, tell=_say, before=before
            )
        calibration.save(file)
        _say(f"saved {file}, calibration {calibration.digest}")
    desktop, _ = make_desktop(settings)
    _say("Trying it: hands off mouse and keyboard.")
    try:
        return 0 if try_out(desktop, settings.time_limits, _say) else 1
    finally:
        desktop.close()


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


main()
