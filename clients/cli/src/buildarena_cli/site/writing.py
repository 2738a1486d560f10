"""Writing of a site: long downloads first, the files that complete it last."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from buildarena_cli.errors import CommandError
from buildarena_cli.site.boards import Collected
from buildarena_cli.site.fetch import Answers, ask, page, question
from buildarena_cli.site.folder import MARKER, Folder, as_json, job_file
from buildarena_cli.site.scope import Job, Scope, digest_of
from buildarena_cli.terminal.output import is_terminal
from buildarena_client.client import Client
from buildarena_client.errors import TooLargeError
from buildarena_client.paths import at

INDEX: Final = "index.html"
SITE: Final = "site.json"
COMPRESSED: Final = (".br", ".gz")
"""Copies for the service; file servers compress by themselves."""
POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'"
)
"""The service's, as far as a page can state it by itself."""
_HEAD: Final = f"""<head>
    <meta charset="utf-8" />
    <meta http-equiv="Content-Security-Policy" content="{POLICY}" />
    <meta name="buildarena-site" content="{SITE}" />
    <meta name="referrer" content="no-referrer" />"""
_BEGIN: Final = re.compile(r'<head>\s*<meta charset="utf-8" */?>')
_ADDRESS: Final = re.compile(r'\b(src|href)="/(?!/)')
_WITHOUT_SCRIPT: Final = re.compile(r"<noscript>.*?</noscript>", re.DOTALL)


def built_pages() -> Path:
    """Return the folder of the built pages, which is part of the API's package.

    Raises:
        CommandError: They were not built.
    """
    package = find_spec("buildarena_api")
    for place in (package.submodule_search_locations or ()) if package else ():
        folder = Path(place, "pages")
        if (folder / INDEX).is_file():
            return folder
    raise CommandError("the dashboard's pages have not been built: `make web` builds them")


def page_files(folder: Path) -> list[Path]:
    """Return the files of the built pages except the first page, relative to their folder."""
    return [
        file.relative_to(folder)
        for file in sorted(folder.rglob("*"))
        if file.is_file()
        and not file.name.startswith(".")
        and file.suffix not in COMPRESSED
        and file != folder / INDEX
    ]


def first_page(folder: Path) -> str:
    """Return the first page of a site, which uses relative paths and stored answers.

    Raises:
        CommandError: The built page does not match this program's version.
    """
    text, heads = _BEGIN.subn(
        lambda _: _HEAD, (folder / INDEX).read_text(encoding="utf-8"), count=1
    )
    text, addresses = _ADDRESS.subn(r'\1="./', text)
    if not (heads and addresses):
        raise CommandError(f"{folder / INDEX} is of another version: `make web` builds it again")
    return _WITHOUT_SCRIPT.sub("<noscript>This site needs JavaScript.</noscript>", text)


ARROW: Final = "application/vnd.apache.arrow.stream"
ROLLOUT: Final = re.compile(r"trajectory-([0-9]+)")
ENDINGS: Final = {"application/json": "json", "text/plain": "txt", "image/png": "png"}


def job_answers(client: Client, job_id: str) -> Answers:
    """Return all answers about a job that has ended."""
    answers: Answers = {}

    def put(path: str = "", **params: Any) -> None:
        # Pages show a file without an entry as omitted: it is too large.
        key = f"/v1/jobs/{job_id}" + (f"/{path}" if path else "")
        asked = {name: value for name, value in params.items() if name not in {"ending", "accept"}}
        with contextlib.suppress(TooLargeError):
            answers[question(key, asked)] = ask(client, key, **params)

    put()
    detail = answers[f"/v1/jobs/{job_id}"]
    artifacts = {} if detail is None else json.loads(detail.content)["artifacts"]
    put("transcript")
    put("prompts")
    put("replay")
    for name in artifacts:
        if match := ROLLOUT.fullmatch(name):
            put("scene", number=int(match[1]))
            put("trajectory", ending="arrow", accept=ARROW, number=int(match[1]))
    if "machine" in artifacts:
        put("machine.glb", ending="glb", accept="model/gltf-binary")
        put("thumbnail.png", ending="png", accept="image/png")
    listed = ask(client, f"/v1/jobs/{job_id}/artifacts")
    rows = [] if listed is None else json.loads(listed.content)["data"]
    files = [file for file in rows if ROLLOUT.fullmatch(file["name"]) is None]
    answers[f"/v1/jobs/{job_id}/artifacts"] = page(files)
    for file in files:
        path = at("jobs", job_id, "artifacts", file["name"])
        ending = ENDINGS.get(file["media_type"], "bin")
        answers[f"/v1/jobs/{job_id}/artifacts/{file['name']}"] = ask(client, path, ending=ending)
    return answers


AT_ONCE: Final = 4
"""Jobs that are asked for at once; the service bounds the requests of one caller."""
NO_JEKYLL: Final = ".nojekyll"
"""Tells GitHub's pages to leave every file as it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """Result of writing a site.

    Attributes:
        holds: Sentence about the content.
        left_out: Sentences about omitted content.
        size: Size of the site, bytes.
    """

    holds: str
    left_out: Sequence[str]
    size: int


def write_site(
    client: Client, scope: Scope, chosen: Sequence[Job], folder: Folder, pages: Path
) -> Written:
    """Write a site, or continue to write an interrupted one.

    Args:
        chosen: Jobs that are stored completely.
        folder: Folder of the site, whose stored answers are reused.
        pages: Folder of the built pages.

    Raises:
        CommandError: The folder can't be written, or another process writes it.
    """
    collected = Collected(client, scope)
    collected.collect()
    with folder.opened():
        paths = {MARKER, NO_JEKYLL, INDEX, SITE}
        folder.write(NO_JEKYLL, b"")
        for file in page_files(pages):
            folder.write(file.as_posix(), (pages / file).read_bytes())
            paths.add(file.as_posix())
        answers = _keep(folder, collected.answers)
        kept = [job["id"] for job in chosen]
        rows = {"jobs": list(scope.jobs), "kept": kept, "sweeps": scope.places}
        stored_rows = folder.keep(as_json(rows), "json")
        job_names = _keep_jobs(client, chosen, folder)
        paths.update(job_file(job_id) for job_id in job_names)
        for names in (answers, *job_names.values()):
            paths.update(name for name in names.values() if name is not None)
        paths.add(stored_rows)
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
        folder.remove_unlisted(paths)
        size = sum((folder.path / name).stat().st_size for name in paths)
    return Written(holds=holds, left_out=left_out, size=size)


def _keep_jobs(
    client: Client, chosen: Sequence[Job], folder: Folder
) -> dict[str, Mapping[str, str | None]]:
    """Store the answers of each job, several at once, and return their places."""
    from rich.progress import track

    def keep(job: Job) -> Mapping[str, str | None]:
        stored = folder.job_answers(job["id"], digest_of(job))
        if stored is not None:
            return stored
        names = _keep(folder, job_answers(client, job["id"]))
        folder.keep_job(job["id"], digest_of(job), names)
        return names

    pool = ThreadPoolExecutor(AT_ONCE)
    try:
        results = zip(chosen, pool.map(keep, chosen), strict=True)
        shown = track(results, "jobs", total=len(chosen), disable=not is_terminal())
        return {job["id"]: names for job, names in shown}
    finally:
        pool.shutdown(cancel_futures=True)


def _keep(folder: Folder, answers: Answers) -> dict[str, str | None]:
    return {
        key: None if answer is None else folder.keep(answer.content, answer.ending)
        for key, answer in answers.items()
    }


def _holds(scope: Scope, chosen: Sequence[Job]) -> str:
    """Return a site's content as a sentence."""
    jobs, names = len(scope.jobs), [str(sweep["name"]) for sweep in scope.sweeps]
    sweeps = _many(len(names), "sweep") + f" ({', '.join(names)})" if names else ""
    track = f"the track {scope.track}" if scope.track else ""
    about = " on ".join(filter(None, [sweeps, track]))
    complete = f"{len(chosen):,} of them" if len(chosen) < jobs else "all"
    return f"It holds {about}, {_many(jobs, 'job')}, {complete} with transcript, replay and trials."


def _left_out(scope: Scope, chosen: Sequence[Job]) -> list[str]:
    ended = len(scope.ended)
    remarks = []
    if open_ := len(scope.jobs) - ended:
        remarks.append(f"{_many(open_, 'job')} had not ended.")
    if reduced := ended - len(chosen):
        remarks.append(f"Of {_many(reduced, 'job')} only the results are included.")
    return remarks


def _many(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
