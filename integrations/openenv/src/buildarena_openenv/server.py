"""The server: OpenEnv's own application around our environment."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import partial
from typing import Final

import uvicorn
from fastapi import FastAPI
from openenv.core.env_server.http_server import create_app
from openenv.core.env_server.types import ConcurrencyConfig

from buildarena_environment import DEFAULT_STEPS, REWARDS, TrialPool
from buildarena_openenv.body_limit import BodyLimitMiddleware
from buildarena_openenv.environment import (
    DEFAULT_TASK,
    BuildEnvironment,
    Terms,
)
from buildarena_openenv.models import BuildAction, BuildObservation, BuildState
from buildarena_simulation import DEFAULT_ENGINE

MAX_SESSIONS: Final = 64
SESSION_IDLE_S: Final = 1800.0
TRIAL_TIMEOUT_S: Final = 120.0
MAX_MESSAGE: Final = 256 * 1024
"""Bytes of a message or a request; a call has a few hundred."""
CONNECTIONS: Final = 8
"""Connections at once for each session that there may be; others get 503."""


def build_app(
    terms: Terms | None = None,
    *,
    max_sessions: int = MAX_SESSIONS,
    session_idle_s: float = SESSION_IDLE_S,
    processes: int | None = None,
    trial_timeout_s: float = TRIAL_TIMEOUT_S,
) -> FastAPI:
    """The application; its trial processes start with the first trial and end with it.

    Args:
        terms: What it offers.
        max_sessions: Sessions at once; another one is refused.
        session_idle_s: Seconds without a message after which a session ends.
        processes: Processes that try machines, for all sessions together; by default one for each
            core.
        trial_timeout_s: Seconds after which a trial is broken off.

    Raises:
        ValueError: A setting does not exist or is out of range.
    """
    pool = TrialPool(processes, timeout_s=trial_timeout_s)
    make = partial(BuildEnvironment, terms or Terms(), pool)
    make()
    app = create_app(
        make,
        BuildAction,
        BuildObservation,
        env_name="buildarena",
        concurrency_config=ConcurrencyConfig(
            max_concurrent_envs=max_sessions, session_timeout=session_idle_s
        ),
        state_cls=BuildState,
    )
    app.add_middleware(BodyLimitMiddleware, limit=MAX_MESSAGE)
    app.router.on_shutdown.append(pool.close)
    return app


def main(arguments: Sequence[str] | None = None) -> None:
    """Serves until it is stopped."""
    parser = argparse.ArgumentParser(
        prog="buildarena-openenv", description="Serves BuildArena's tasks over OpenEnv's protocol."
    )
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument("--task", default=DEFAULT_TASK, help="of episodes whose client names none")
    parser.add_argument("--simulator", default=DEFAULT_ENGINE)
    parser.add_argument(
        "--reward",
        action="append",
        type=_weight,
        metavar="NAME=WEIGHT",
        help=f"of {', '.join(REWARDS)}; may be given again; success=1 without one",
    )
    parser.add_argument("--max-steps", type=int, default=DEFAULT_STEPS)
    parser.add_argument("--max-sessions", type=int, default=MAX_SESSIONS)
    parser.add_argument("--processes", type=int, default=None, help="that try machines")
    given = parser.parse_args(arguments)
    terms = Terms(
        task=given.task,
        simulator=given.simulator,
        max_steps=given.max_steps,
        rewards=None if given.reward is None else dict(given.reward),
    )
    try:
        app = build_app(terms, max_sessions=given.max_sessions, processes=given.processes)
    except ValueError as error:
        parser.error(str(error))
    uvicorn.run(
        app,
        host=given.host,
        port=given.port,
        ws_max_size=MAX_MESSAGE,
        limit_concurrency=CONNECTIONS * given.max_sessions,
    )


def _weight(text: str) -> tuple[str, float]:
    name, equals, weight = text.partition("=")
    try:
        value = float(weight) if equals else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(
            f"{text[:60]!r}: expected NAME=WEIGHT, such as indicator=0.5"
        )
    return name, value


if __name__ == "__main__":
    main()
