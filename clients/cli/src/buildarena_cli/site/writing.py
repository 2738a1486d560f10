"""A site is measured, then written: what takes long first, what makes it whole last."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import fmean
from typing import Any, Final, TypeVar

from buildarena_cli.client import Client
from buildarena_cli.site.asking import Answer, Answers
from buildarena_cli.site.boards import Collected, questions, rows_of
from buildarena_cli.site.folder import MARKER, Folder, as_json, job_file, name_of
from buildarena_cli.site.jobs import job_answers
from buildarena_cli.site.pages import INDEX, SITE, first_page, page_files
from buildarena_cli.site.previews import (
    best_picture,
    head,
    job_preview,
    job_preview_file,
    thumbnail_of,
)
from buildarena_cli.site.scope import Job, Scope, digest_of
from buildarena_cli.terminal.counting import counted

Result = TypeVar("Result")

AT_ONCE: Final = 4
"""Jobs that are asked for at once; the service bounds the requests of one caller."""
SAMPLED: Final = 24
"""Jobs at most whose size is measured before the others are asked for."""
SAMPLED_OF_A_KIND: Final = 2
INDEX_OF_A_JOB: Final = 2_500
"""Approximate bytes of the file that says where a job's answers are."""
NO_JEKYLL: Final = ".nojekyll"
"""Tells GitHub's pages to leave every file as it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A site that can be written.

    Attributes:
        scope: What it is about.
        chosen: Jobs that are kept whole.
        boards: Answers that are of no single job.
        left_out: Sentences about what it leaves out.
        here: Answers of chosen jobs that the folder has already, by job.
        sampled: Answers of chosen jobs that were asked for already, by job.
        pages: The folder of the built pages.
        size: Bytes that it will be, about.
    """

    scope: Scope
    chosen: Sequence[Job]
    boards: Answers
    left_out: Sequence[str]
    here: Mapping[str, Mapping[str, str | None]]
    sampled: Mapping[str, Answers]
    pages: Path
    size: int

    @property
    def holds(self) -> str:
        """What it holds, as a sentence."""
        jobs, names = len(self.scope.jobs), [str(sweep["name"]) for sweep in self.scope.sweeps]
        what = _many(len(names), "sweep") + f" ({', '.join(names)})" if names else ""
        track = f"the track {self.scope.track}" if self.scope.track else ""
        about = " on ".join(filter(None, [what, track]))
        whole = f"{len(self.chosen):,} of them" if len(self.chosen) < jobs else "all"
        return (
            f"It holds {about}, {_many(jobs, 'job')}, {whole} with transcript, replay and trials."
        )


def plan_site(
    client: Client, scope: Scope, chosen: Sequence[Job], folder: Folder, pages: Path
) -> Plan:
    """Asks for what a site's pages share, and measures how large it will be.

    Args:
        client: The API.
        scope: What the site is about.
        chosen: Jobs that are kept whole.
        folder: Where it is to be written; what is there already is not asked for again.
        pages: The folder of the built pages.
    """
    here = {
        job["id"]: known
        for job in chosen
        if (known := folder.job_answers(job["id"], digest_of(job))) is not None
    }
    with counted("boards", sum(questions(scope))) as done:
        collected = Collected(client, scope, done)
        collected.collect()
    missing = [job for job in chosen if job["id"] not in here]
    sample = _sample(missing)
    with counted("sizes", len(sample)) as done:
        sampled = _every(lambda job: job_answers(client, job["id"]), sample, done)
    answers = [*collected.answers.values(), rows_of(scope, chosen)]
    files = {name for names in here.values() for name in names.values() if name is not None}
    return Plan(
        scope=scope,
        chosen=chosen,
        boards=collected.answers,
        left_out=[*_left_out(scope, chosen), *collected.left_out],
        here=here,
        sampled=sampled,
        pages=pages,
        size=sum((pages / file).stat().st_size for file in page_files(pages))
        + _size(answers)
        + sum((folder.path / name).stat().st_size for name in files)
        + _estimated(missing, sampled)
        + INDEX_OF_A_JOB * len(chosen),
    )


def write_site(client: Client, plan: Plan, folder: Folder) -> int:
    """Writes a site; an interrupted one continues when it is written again.

    Args:
        client: The API.
        plan: The site.
        folder: Where to.

    Returns:
        Its size in bytes.

    Raises:
        CommandError: The folder can't be written, or another process writes it.
    """
    with folder.opened():
        wanted = {MARKER, NO_JEKYLL, INDEX, SITE}
        folder.write(NO_JEKYLL, b"")
        for file in page_files(plan.pages):
            folder.write(file.as_posix(), (plan.pages / file).read_bytes())
            wanted.add(file.as_posix())
        answers = _keep(folder, plan.boards)
        rows = rows_of(plan.scope, plan.chosen)
        stored_rows = folder.keep(rows.content, rows.ending)
        job_names = _keep_jobs(client, plan, folder)
        wanted.update(job_file(job_id) for job_id in job_names)
        for job in plan.chosen:
            picture = thumbnail_of(job["id"], job_names[job["id"]])
            folder.write(job_preview_file(job["id"]), job_preview(job, picture).encode())
            wanted.add(job_preview_file(job["id"]))
        for names in (answers, *job_names.values()):
            wanted.update(name for name in names.values() if name is not None)
        wanted.add(stored_rows)
        folder.write(SITE, as_json(_site(plan, answers, stored_rows)))
        preview = head("BuildArena", plan.holds, best_picture(list(plan.chosen), job_names))
        folder.write(INDEX, first_page(plan.pages, preview).encode())
        folder.remove_others(wanted)
        return sum((folder.path / name).stat().st_size for name in wanted)


def _keep_jobs(client: Client, plan: Plan, folder: Folder) -> dict[str, Mapping[str, str | None]]:
    def keep(job: Job) -> Mapping[str, str | None]:
        if job["id"] in plan.here:
            return plan.here[job["id"]]
        answers = plan.sampled.get(job["id"]) or job_answers(client, job["id"])
        names = _keep(folder, answers)
        folder.keep_job(job["id"], digest_of(job), names)
        return names

    with counted("jobs", len(plan.chosen)) as done:
        return _every(keep, plan.chosen, done)


def _keep(folder: Folder, answers: Answers) -> dict[str, str | None]:
    return {
        key: None if answer is None else folder.keep(answer.content, answer.ending)
        for key, answer in answers.items()
    }


def _every(
    work: Callable[[Job], Result], jobs: Sequence[Job], done: Callable[[], None]
) -> dict[str, Result]:
    """What work finds for each job, some at a time; the first error ends it."""
    results: dict[str, Result] = {}
    pool = ThreadPoolExecutor(AT_ONCE)
    try:
        for job, result in zip(jobs, pool.map(work, jobs), strict=True):
            results[job["id"]] = result
            done()
    finally:
        pool.shutdown(cancel_futures=True)
    return results


def _site(plan: Plan, answers: Mapping[str, str | None], rows: str) -> dict[str, Any]:
    return {
        "version": 1,
        "written_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "holds": plan.holds,
        "left_out": list(plan.left_out),
        "sweeps": [sweep["id"] for sweep in plan.scope.sweeps],
        "kept": len(plan.chosen),
        "jobs": rows,
        "answers": dict(answers),
    }


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


def _kind(job: Job) -> tuple[str, str]:
    """What best predicts the size of a job's answers."""
    return job["task"], job["outcome"]


def _sample(jobs: Sequence[Job]) -> list[Job]:
    """Some jobs of each kind."""
    kinds: dict[tuple[str, str], list[Job]] = {}
    for job in jobs:
        kinds.setdefault(_kind(job), []).append(job)
    firsts = [jobs_of_kind[:SAMPLED_OF_A_KIND] for jobs_of_kind in kinds.values()]
    rounds = itertools.zip_longest(*firsts)
    return [job for turn in rounds for job in turn if job is not None][:SAMPLED]


def _size(answers: Sequence[Answer | None]) -> int:
    """Bytes of answers, equal ones counted once."""
    sizes = {name_of(a.content, a.ending): len(a.content) for a in answers if a is not None}
    return sum(sizes.values())


def _estimated(jobs: Sequence[Job], sampled: Mapping[str, Answers]) -> int:
    """Bytes of jobs, from those of their kind that were measured."""
    sizes: dict[tuple[str, str], list[int]] = {}
    for job in jobs:
        if job["id"] in sampled:
            job_files = list(sampled[job["id"]].values())
            sizes.setdefault(_kind(job), []).append(_size(job_files))
    every = [size for kind_sizes in sizes.values() for size in kind_sizes]
    return round(sum(fmean(sizes.get(_kind(job), every)) for job in jobs)) if every else 0
