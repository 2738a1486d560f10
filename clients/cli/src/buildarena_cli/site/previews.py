"""What others show of a site where its address is sent: a title, a sentence, a picture.

Programs that make previews run no script: they read the first page's head, and a small page for
each stored job, which leads on to the job.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from typing import Any, Final

from buildarena_cli.site.folder import JOBS

REDIRECT_POLICY: Final = "default-src 'none'"


def head(title: str, sentence: str, picture: str | None, *, above: str = "") -> str:
    """Elements of a page's head.

    Args:
        title: What the page is about.
        sentence: What it shows.
        picture: Path of a picture within the site, if there is one.
        above: The way from the page up to the site's folder.
    """
    properties = {"og:type": "website", "og:title": title, "og:description": sentence}
    if picture is not None:
        properties["og:image"] = above + picture
        properties["twitter:card"] = "summary_large_image"
    return "".join(
        [
            f'<meta name="description" content="{escape(sentence)}" />',
            *(
                f'<meta property="{name}" content="{escape(text)}" />'
                for name, text in properties.items()
            ),
        ]
    )


def job_preview_file(job_id: str) -> str:
    """The path of a job's small page within a site."""
    return f"{JOBS}/{job_id}.html"


def thumbnail_of(job_id: str, answers: Mapping[str, str | None]) -> str | None:
    """The path of a stored job's picture within a site."""
    return answers.get(f"/v1/jobs/{job_id}/thumbnail.png")


def job_preview(job: Mapping[str, Any], picture: str | None) -> str:
    """A page that leads on to a job.

    Args:
        job: Its row.
        picture: Path of its picture within the site.
    """
    title = f"{job['task']} by {job['model']}, seed {job['seed']}"
    outcome = str(job["reason"] or job["outcome"]).replace("_", " ")
    figure = job.get("indicator")
    measured = "" if figure is None else f", {figure:,.2f}"
    address = f"../#/jobs/{job['id']}"
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8" />'
        f'<meta http-equiv="Content-Security-Policy" content="{REDIRECT_POLICY}" />'
        f"<title>{escape(title)}, BuildArena</title>"
        f"{head(title, f'{outcome}{measured}', picture, above='../')}"
        f'<meta http-equiv="refresh" content="0; url={escape(address)}" /></head>'
        f'<body><a href="{escape(address)}">{escape(title)}</a></body></html>'
    )


def best_picture(
    jobs: list[Mapping[str, Any]], stored: Mapping[str, Mapping[str, str | None]]
) -> str | None:
    """The picture of the most successful stored job that has one.

    Args:
        jobs: Rows of jobs.
        stored: Answers of stored jobs.
    """
    ranked = sorted(jobs, key=lambda job: (not job["success"], json.dumps(job["id"])))
    pictures = (thumbnail_of(job["id"], stored.get(job["id"], {})) for job in ranked)
    return next((picture for picture in pictures if picture is not None), None)
