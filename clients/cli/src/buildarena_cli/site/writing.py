"""A site is written: what takes long first, what makes it whole last."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from buildarena_cli.client import Client
from buildarena_cli.site.asking import Answers
from buildarena_cli.site.boards import Collected, rows_of
from buildarena_cli.site.folder import MARKER, Folder, as_json, job_file
from buildarena_cli.site.jobs import job_answers
from buildarena_cli.site.pages import INDEX, SITE, first_page, page_files
from buildarena_cli.site.scope import Job, Scope, digest_of
from buildarena_cli.terminal.output import is_terminal

AT_ONCE: Final = 4
"""Jobs that are asked for at once; the service bounds the requests of one caller."""
NO_JEKYLL: Final = ".nojekyll"
"""Tells GitHub's pages to leave every file as it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """A site that was written.

    Attributes:
        holds: What it holds, as a sentence.
        left_out: Sentences about what it leaves out.
        size: Its bytes.
    """

    holds: str
    left_out: Sequence[str]
    size: int


def write_site(
    client: Client, scope: Scope, chosen: Sequence[Job], folder: Folder, pages: Path
) -> Written:
    """Writes a site; an interrupted one continues when it is written again.

    Args:
        client: The API.
        scope: What the site is about.
        chosen: Jobs that are kept whole.
        folder: Where to; what is there already is not asked for again.
        pages: The folder of the built pages.

    Raises:
        CommandError: The folder can't be written, or another process writes it.
    """
    collected = Collected(client, scope)
    collected.collect()
    with folder.opened():
        wanted = {MARKER, NO_JEKYLL, INDEX, SITE}
        folder.write(NO_JEKYLL, b"")
        for file in page_files(pages):
            folder.write(file.as_posix(), (pages / file).read_bytes())
            wanted.add(file.as_posix())
        answers = _keep(folder, collected.answers)
        rows = rows_of(scope, chosen)
        stored_rows = folder.keep(rows.content, rows.ending)
        job_names = _keep_jobs(client, chosen, folder)
        wanted.update(job_file(job_id) for job_id in job_names)
        for names in (answers, *job_names.values()):
            wanted.update(name for name in names.values() if name is not None)
        wanted.add(stored_rows)
        holds, left_out = _holds(scope, chosen), [*_left_out(scope, chosen), *collected.left_out]
        site = {
            "version": 1,
            "written_at": datetime.now(UTC).isoformat(timespec="seconds"),
            "holds": holds,
            "left_out": left_out,
            "sweeps": [sweep["id"] for sweep in scope.sweeps],
            "kept": len(chosen),
            "jobs": stored_rows,
            "answers": answers,
        }
        folder.write(SITE, as_json(site))
        folder.write(INDEX, first_page(pages).encode())
        folder.remove_others(wanted)
        size = sum((folder.path / name).stat().st_size for name in wanted)
    return Written(holds=holds, left_out=left_out, size=size)


def _keep_jobs(
    client: Client, chosen: Sequence[Job], folder: Folder
) -> dict[str, Mapping[str, str | None]]:
    """Where the answers of each job are, some asked for at a time; the first error ends it."""
    from rich.progress import track

    def keep(job: Job) -> Mapping[str, str | None]:
        here = folder.job_answers(job["id"], digest_of(job))
        if here is not None:
            return here
        names = _keep(folder, job_answers(client, job["id"]))
        folder.keep_job(job["id"], digest_of(job), names)
        return names

    pool = ThreadPoolExecutor(AT_ONCE)
    try:
        kept = zip(chosen, pool.map(keep, chosen), strict=True)
        shown = track(kept, "jobs", total=len(chosen), disable=not is_terminal())
        return {job["id"]: names for job, names in shown}
    finally:
        pool.shutdown(cancel_futures=True)


def _keep(folder: Folder, answers: Answers) -> dict[str, str | None]:
    return {
        key: None if answer is None else folder.keep(answer.content, answer.ending)
        for key, answer in answers.items()
    }


def _holds(scope: Scope, chosen: Sequence[Job]) -> str:
    """What a site holds, as a sentence."""
    jobs, names = len(scope.jobs), [str(sweep["name"]) for sweep in scope.sweeps]
    what = _many(len(names), "sweep") + f" ({', '.join(names)})" if names else ""
    track = f"the track {scope.track}" if scope.track else ""
    about = " on ".join(filter(None, [what, track]))
    whole = f"{len(chosen):,} of them" if len(chosen) < jobs else "all"
    return f"It holds {about}, {_many(jobs, 'job')}, {whole} with transcript, replay and trials."


def _left_out(scope: Scope, chosen: Sequence[Job]) -> list[str]:
    ended = len(scope.ended)
    remarks = []
    if open_ := len(scope.jobs) - ended:
        remarks.append(f"{_many(open_, 'job')} had not ended.")
    if rest := ended - len(chosen):
        remarks.append(f"Of {_many(rest, 'job')} only the results are kept.")
    return remarks


def _many(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"
