"""Checks if a runner could work from here, before one is started."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from buildarena_backend.errors import StartupError
from buildarena_backend.settings import Settings
from buildarena_backend.trials.installed_simulators import installed_simulators
from buildarena_simworker.remote.api import RefusedError, RemoteError, RunnerApi
from buildarena_simworker.remote.process import KEY_VARIABLE, read_key

RETRY_FOR_S: Final = 5.0

Check = dict[str, Any]


def check_runner(
    url: str,
    simulator: str,
    *,
    key_file: Path | None = None,
    ca_file: Path | None = None,
    allow_http: bool = False,
) -> Iterator[Check]:
    """Yield a runner's requirements, each with name, success, detail and advice.

    Args:
        url: Address of the API.
        simulator: Simulator of the runner.
        key_file: File with the runner key. Defaults to BUILDARENA_KEY.
        ca_file: Certificates to trust besides the system's.
        allow_http: True if the key may be sent unencrypted to another machine.
    """
    settings = Settings()
    installed = installed_simulators()[simulator]
    yield _check("simulator", *installed.examine(settings))
    try:
        api = RunnerApi(
            url,
            read_key(key_file),
            ca_file=ca_file,
            allow_http=allow_http,
            stopping=threading.Event(),
        )
    except StartupError as error:
        yield _check("settings", str(error), "correct --api, --key-file or --ca-file")
        return
    try:
        facts = api.facts(retry_for_s=RETRY_FOR_S)
    except RefusedError as error:
        command = f"buildarena admin key create NAME --scope runner --simulator {simulator}"
        advice = f"have an admin make one: {command}; set {KEY_VARIABLE} or --key-file"
        yield _check("key", str(error), advice)
        return
    except RemoteError as error:
        yield _check("api", str(error), "is the address right, and does a firewall let it pass?")
        return
    finally:
        api.close()
    yield _check("api", f"{url} answers")
    allowed = facts["simulators"]
    detail = f"may lease jobs of {', '.join(allowed) or 'nothing'}"
    yield _check("key", detail, "" if simulator in allowed else f"it needs one for {simulator}")
    local_version, served = installed.version(settings), facts["versions"].get(simulator)
    if local_version is not None:
        advice = "" if served == local_version else "install the version that the service has"
        yield _check("version", f"{local_version} here, {served or 'none'} at the service", advice)


def format_checks(checks: Sequence[Check], *, as_json: bool = False) -> str:
    """Format checks for people, a line each, or as JSON for programs."""
    if as_json:
        return json.dumps({"ok": all(c["ok"] for c in checks), "checks": checks}, indent=2) + "\n"
    lines = []
    for check in checks:
        lines.append(f"{check['name']:<10} {'ok' if check['ok'] else 'WRONG':<6} {check['detail']}")
        if check["advice"]:
            lines.append(f"{'':<17} {check['advice']}")
    return "\n".join(lines) + "\n"


def _check(name: str, detail: str, advice: str = "") -> Check:
    return {"name": name, "ok": not advice, "detail": detail, "advice": advice}
