"""A job as a row of a dataset."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from datetime import datetime
from functools import lru_cache
from hashlib import sha256
from typing import Any, Final

from buildarena_backend.agents.briefing import briefing, briefing_digest
from buildarena_backend.catalog.tracks import EXTERNAL_WORKFLOW, has_data_sheets, worlds_of
from buildarena_backend.database.text import clean
from buildarena_benchmark import CANARY, TaskError, parse_task
from buildarena_benchmark.flags import is_disqualified
from buildarena_cli.dataset.messages import chat, compact
from buildarena_cli.dataset.reading import Fetched
from buildarena_cli.errors import CommandError

BASELINE: Final = "builtin/"
OURS: Final = "apache-2.0"
"""Licence of what baselines made: they are part of BuildArena."""
AS_THEY_ARE: Final = (
    *("task", "task_version", "model", "configuration", "track", "seed", "outcome", "reason"),
    *("success", "indicator", "censored", "flags", "actions", "refused_actions"),
)
USAGE: Final = (
    *("requests", "input_tokens", "output_tokens", "cached_tokens", "reasoning_tokens"),
    "cost_usd",
)
NO_VERSION: Final = frozenset({"model", "machine", "trajectory", "rollout", "seed"})
"""Fields of a manifest that are separate columns, or may name an operator's hosts."""


def row_of(fetched: Fetched, *, tools: str, licence: str) -> dict[str, Any]:
    """Return the row of a job.

    Args:
        tools: The tools' definitions.
        licence: Licence of what models, agents and people made.

    Raises:
        CommandError: The job's documents are not what they should be.
    """
    try:
        return _row_of(fetched, tools=tools, licence=licence)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        problem = f"{type(error).__name__}: {error}"
        raise CommandError(
            f"{fetched.job['id']} has documents that can't be read ({problem}): leave it out by a "
            "filter, such as --sweep"
        ) from error


def _row_of(fetched: Fetched, *, tools: str, licence: str) -> dict[str, Any]:
    job = fetched.job
    turns = _turns(fetched.transcript) if fetched.transcript else []
    manifest = job["manifest"] or {}
    track = manifest.get("track") or {}
    return {
        **{name: job[name] for name in AS_THEY_ARE},
        **{name: (job | job["usage"])[name] for name in USAGE},
        **_of_task(fetched.task),
        "job_id": job["id"],
        "decoding": compact((manifest.get("model") or {}).get("decoding") or {}),
        "workflow": track.get("workflow") or job["track"].partition("/")[0],
        "simulator": track.get("simulator"),
        "disqualified": is_disqualified(job["flags"]),
        "metrics": None if job["metrics"] is None else compact(job["metrics"]),
        "messages": chat(_first_words(fetched.task, track), turns, fetched.prompts),
        "tools": tools,
        "machine": None if fetched.machine is None else fetched.machine.decode(),
        "machine_sha256": job["artifacts"].get("machine"),
        "transcript_sha256": (
            None if fetched.transcript is None else sha256(fetched.transcript).hexdigest()
        ),
        "trajectory_sha256": _trajectories(job["artifacts"]),
        "versions": compact({k: v for k, v in manifest.items() if k not in NO_VERSION}),
        "refusals": compact(job["refusals"]),
        "ran_on_runner": job.get("ran_on_runner", False),
        "audit": job["verification_status"],
        # Null for a job that counts without its verification.
        "verified": job["verification_status"] and job["verified_at"] is not None,
        "finished_at": job["finished_at"] and datetime.fromisoformat(job["finished_at"]),
        "license": OURS if job["model"].startswith(BASELINE) else licence,
        "canary": CANARY,
    }


def _turns(transcript: bytes) -> list[dict[str, Any]]:
    turns: list[dict[str, Any]] = json.loads(transcript)["turns"]
    # Half a letter can be spelled in JSON, and in no other file.
    return list(clean(turns)) if b"\\ud" in transcript.lower() else turns


def _of_task(task: Mapping[str, Any] | None) -> dict[str, Any]:
    fields = task or {}
    return {
        "task_title": fields.get("title"),
        "category": fields.get("category"),
        "level": fields.get("level"),
        "custom_task": fields.get("custom"),
        "indicator_name": fields.get("indicator"),
        "indicator_unit": fields.get("unit"),
    }


def _first_words(task: Mapping[str, Any] | None, track: Mapping[str, Any]) -> str | None:
    """Return the first message of a session: the statement, or an agent's briefing."""
    if task is None:
        return None
    as_read = track.get("workflow") == EXTERNAL_WORKFLOW
    data_sheets = has_data_sheets(track)
    digest = briefing_digest(on_demand=bool(track.get("looked_up")), data_sheets=data_sheets)
    if as_read and track.get("prompts_digest") == digest:
        return _briefing(compact(task["document"]), data_sheets, worlds_of(track)) or str(
            task["statement"]
        )
    return str(task["statement"])


@lru_cache(maxsize=64)
def _briefing(document: str, data_sheets: bool, worlds: int) -> str | None:
    """Return the briefing of a task's document; None for an unsupported version."""
    try:
        task = parse_task(document, origin="task")
        return briefing(task, data_sheets=data_sheets, worlds=worlds)
    except TaskError:
        return None


def _trajectories(artifacts: Mapping[str, str]) -> list[str]:
    names = filter(re.compile("trajectory-[0-9]+").fullmatch, artifacts)
    return [artifacts[name] for name in sorted(names, key=lambda name: int(name.split("-")[1]))]
