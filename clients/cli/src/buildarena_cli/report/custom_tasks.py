"""The tasks of a report, and its section on the custom ones."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Any

from buildarena_benchmark.leaderboard import Board, EndedJob
from buildarena_cli.client import Client, RefusedError, at
from buildarena_cli.report.document import Block, Grid, Heading, Paragraph
from buildarena_cli.report.material import Material, ReportTask


def read_tasks(client: Client, trials: Sequence[EndedJob]) -> dict[str, ReportTask]:
    """The tasks by name: of a custom task the version that the report is about.

    That is the newest one, or one that was tried if the newest was not.
    """
    tasks = {}
    listed = {entry["name"]: entry for entry in client.get("/v1/tasks")}
    tried: dict[str, list[EndedJob]] = {}
    for trial in trials:
        tried.setdefault(trial.task, []).append(trial)
    for name in dict.fromkeys([*listed, *tried]):
        entry = listed.get(name)
        if name in tried and (entry is None or entry["custom"]):
            version = _reported(tried[name], entry)
            # A version that is gone is reported as the newest one.
            with contextlib.suppress(RefusedError):
                entry = client.get(at("tasks", name), version=version)
        if entry is not None:
            tasks[name] = _task(entry)
    return tasks


def custom_tasks(material: Material, board: Board) -> list[Block]:
    """What the custom tasks ask for, and which version of them the figures are of."""
    rows = []
    for shown in board.tasks:
        task = material.tasks.get(shown.task)
        if task is not None and task.document is not None:
            rows.append(
                (
                    task.name,
                    task.document["title"],
                    task.version,
                    task.figure(material.policy),
                    *_limits(task.document),
                    str(shown.outdated),
                )
            )
    if not rows:
        return []
    columns = (
        *("task", "title", "version", "indicator", "sub-structures", "blocks in one"),
        *("at least", "trial", "jobs of other versions"),
    )
    return [
        Heading(text="Custom tasks"),
        Paragraph(
            text="The paper has no figures for them. Only results of one version are compared; "
            "jobs of other versions are left out."
        ),
        Grid(caption="What they ask for", columns=columns, rows=rows, text_columns=7),
    ]


def _reported(trials: Sequence[EndedJob], entry: Mapping[str, Any] | None) -> str:
    versions = [trial.task_version for trial in trials]
    if entry is not None and entry["version"] in versions:
        return str(entry["version"])
    return versions[-1]


def _limits(document: Mapping[str, Any]) -> tuple[str, str, str, str]:
    limits = document["constraints"]
    least, most = limits["min_sub_structures"], limits["max_sub_structures"]
    wanted = ", ".join(f"{count} {name}" for name, count in limits["min_modules"].items())
    return (
        str(most) if least == most else f"{least} to {most}",
        str(limits["max_blocks"]),
        wanted or "-",
        f"{document['scenario']['duration_s']:g} s",
    )


def _task(entry: Mapping[str, Any]) -> ReportTask:
    names = ("name", "version", "category", "indicator", "unit", "published_metric", "difficulty")
    document = entry.get("document") if entry["custom"] else None
    return ReportTask(**{name: entry[name] for name in names}, document=document)
