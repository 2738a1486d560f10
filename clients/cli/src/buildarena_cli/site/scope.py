"""Scope of a site: its sweeps or track, and the jobs that are stored completely."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from buildarena_cli.errors import CommandError
from buildarena_cli.ids import checked_id
from buildarena_client.client import Client
from buildarena_client.paths import at

PAGE: Final = 200
EVERY: Final = "all"
CHOICES: Final = (EVERY, "best", "none")
MAX_SWEEPS: Final = 50

Job = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scope:
    """Scope of a site.

    Attributes:
        sweeps: Its sweeps as the API shows them, the newest first; none of a whole track.
        track: Its only track; None when it has all tracks of its sweeps.
        tracks: Its tracks that have a board.
        jobs: Rows of all its jobs, the newest first.
        disqualifying: Flags that make a trial a failure.
        places: By sweep, the places of its jobs among all.
    """

    sweeps: Sequence[Mapping[str, Any]]
    track: str | None
    tracks: Sequence[str]
    jobs: Sequence[Job]
    disqualifying: frozenset[str] = frozenset()
    places: Mapping[str, Sequence[int]] = field(default_factory=dict)

    @property
    def asked(self) -> dict[str, Any]:
        """Parameters that limit a board to this scope."""
        return {"sweep": [sweep["id"] for sweep in self.sweeps] or None, "track": self.track}

    @property
    def ended(self) -> list[Job]:
        """Jobs that have ended."""
        return [job for job in self.jobs if job["state"] == "done"]


def read_scope(client: Client, sweeps: Sequence[str], track: str | None) -> Scope:
    """Read the scope of a site of sweeps, or of a track.

    Args:
        sweeps: Complete ids of sweeps.
        track: Name of a track that limits the scope; None for all.

    Raises:
        CommandError: There is nothing to show, or it has no such track.
    """
    if len(sweeps) > MAX_SWEEPS:
        raise CommandError(f"a site holds {MAX_SWEEPS} sweeps at most; these are {len(sweeps)}")
    documents = [client.get(at("sweeps", id_)) for id_ in dict.fromkeys(sweeps)]
    board = client.get("/v1/leaderboard", sweep=list(sweeps) or None)
    if track is not None and track not in board["tracks"]:
        choices = ", ".join(board["tracks"]) or "none: no job has ended"
        raise CommandError(f"unknown track {track!r}; valid tracks: {choices}")
    jobs: dict[str, Job] = {}
    members: dict[str, list[str]] = {}
    for sweep in [sweep["id"] for sweep in documents] or [None]:
        rows = [
            job
            for page in client.pages("/v1/jobs", sweep=sweep, track=track, limit=PAGE)
            for job in page["data"]
        ]
        # Ids become names of files.
        jobs.update((checked_id("job", job["id"]), job) for job in rows)
        if sweep is not None:
            members[sweep] = [job["id"] for job in rows]
    ordered = sorted(jobs.values(), key=lambda job: (job["created_at"], job["id"]), reverse=True)
    place = {job["id"]: index for index, job in enumerate(ordered)}
    if not any(job["state"] == "done" for job in ordered):
        raise CommandError("none of these jobs has ended, so there is nothing to publish")
    return Scope(
        sweeps=sorted(documents, key=lambda sweep: str(sweep["created_at"]), reverse=True),
        track=track,
        tracks=[track] if track is not None else board["tracks"],
        jobs=ordered,
        disqualifying=frozenset(flag["name"] for flag in board["flags"] if flag["disqualifying"]),
        places={id_: [place[job] for job in rows] for id_, rows in members.items()},
    )


def read_choice(choice: str) -> int | None:
    """Return the number of jobs of a cell to store completely; None means all.

    Args:
        choice: Name in CHOICES, or a number.

    Raises:
        CommandError: The choice is neither.
    """
    if choice.isdecimal() and choice.isascii():
        return int(choice)
    if choice not in CHOICES:
        raise CommandError(f"--jobs: {choice!r}: valid choices: {', '.join(CHOICES)} or a number")
    return {EVERY: None, "best": 1, "none": 0}[choice]


def choose_jobs(scope: Scope, per_cell: int | None) -> list[Job]:
    """Return the ended jobs to store completely: the best of each cell, successes first.

    Args:
        scope: Scope of the site. A cell is a task's version, a model's configuration and a track.
        per_cell: Maximum number of jobs of a cell; None for all.
    """
    jobs = scope.ended
    if per_cell is None:
        return jobs
    cells: dict[tuple[str, ...], list[Job]] = {}
    for job in jobs:
        names = ("task", "task_version", "configuration", "track")
        cells.setdefault(tuple(job[name] for name in names), []).append(job)

    def worth(job: Job) -> tuple[bool, float, int, str]:
        failed = not job["success"] or not scope.disqualifying.isdisjoint(job["flags"])
        return failed, -(job["indicator"] or 0.0), job["seed"], job["id"]

    return [job for cell in cells.values() for job in sorted(cell, key=worth)[:per_cell]]


def digest_of(job: Job) -> str:
    """Return a digest of a job that changes with its score or record."""
    from hashlib import sha256

    return sha256(json.dumps(job, sort_keys=True).encode()).hexdigest()
