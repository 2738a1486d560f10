"""Where a session's input tokens go; run by `make bench-tokens`.

The expert plays each task in the default workflow. Its requests are cut into what they consist
of: tool schemas, system messages, openings, own words, others' words and tool answers. Tokens are
characters / 4, as built-in models count them; ratios do not depend on that. The baseline is what
the same sessions took before guidance gave lists of steps.
"""

import argparse
import json
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

from benchmarks.figures import keep
from support.player import Player
from support.providers.scripted import Recording

from buildarena_benchmark import builtin_tasks
from buildarena_worker.builtin import CHARACTERS_PER_TOKEN
from buildarena_worker.session.messages import Request

PARTS = ("schemas", "system", "opening", "own words", "others", "tool answers")
BASELINE = {
    "flight-1": (41, 65141),
    "flight-2": (52, 78524),
    "mechanisms-1": (130, 372455),
    "mechanisms-2": (50, 81911),
    "mechanisms-3": (162, 512726),
    "mechanisms-4": (70, 122992),
    "support-1": (32, 36083),
    "transport-1": (38, 44096),
    "lift-3": (73, 89336),
}
"""Requests and input tokens of the expert's sessions when a builder got one step at a time and each
role the whole list of modules, without data; schemas included."""
WORKSHOP = ("flight", "mechanisms")
PUBLISHED = {"support-1": (67, 630_000)}
"""Mean requests and input tokens of the paper's models."""
BAR = 0.5
"""Of tasks of the workshop, whose modules are many."""
LOOKED_UP_TASK = "transport-1"
LOOKED_UP_IN = ("builder", "guidance-builder", "five-role")
LOOKED_UP_BAR = {"builder": 0.5}
"""Of one who builds alone, and carries the list through every turn. Where several roles share the
work most of them never read it, so that there is less to save."""


def parts_of(request: Request) -> dict[str, int]:
    """Characters of a request by what they are."""
    found = dict.fromkeys(PARTS, 0)
    if request.tools:
        schemas = [[tool.name, tool.description, tool.parameters] for tool in request.tools]
        found["schemas"] = len(json.dumps(schemas, separators=(",", ":")))
    kinds = {"system": "system", "tool": "tool answers", "assistant": "own words"}
    for number, message in enumerate(request.messages):
        kind = kinds.get(message.role) or ("opening" if number == 1 else "others")
        calls = sum(len(call.name) + len(json.dumps(call.arguments)) for call in message.calls)
        found[kind] += len(message.text) + calls
    return found


def measured(task: str) -> dict[str, dict[str, int]]:
    """Tokens by stage and role, and by part; requests under "requests"."""
    model = Recording()
    played = Player()("builtin/expert", task=task, client=model)
    stages: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for turn, request in zip(played.session.transcript.turns, model.requests, strict=True):
        row = stages[f"{turn.stage}/{turn.role}"]
        row["requests"] += 1
        for part, characters in parts_of(request).items():
            row[part] += characters
    return {
        stage: {
            key: value if key == "requests" else value // CHARACTERS_PER_TOKEN
            for key, value in row.items()
        }
        for stage, row in stages.items()
    }


def told_and_looked_up(workflow: str) -> tuple[int, int]:
    """Input tokens of the expert's session that is told forty modules, and that looks them up."""
    totals = []
    for how in ("inline", "on_demand"):
        given = builtin_tasks()[LOOKED_UP_TASK]
        update = {"modules": "workshop", "module_list": how}
        task = replace(given, constraints=given.constraints.model_copy(update=update))
        model = Recording()
        played = Player()("builtin/expert", task=task, client=model, workflow=workflow)
        if played.failure is not None:
            raise SystemExit(f"{workflow}, {how}: the expert failed: {played.failure}")
        characters = sum(sum(parts_of(request).values()) for request in model.requests)
        totals.append(characters // CHARACTERS_PER_TOKEN)
    return totals[0], totals[1]


def main() -> int:
    """Runs the benchmark.

    Returns:
        The exit code: 1 if a task of the workshop takes more than half of what it took, or looking
        modules up more than half of what telling them takes.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="where the figures go")
    parser.add_argument("--tasks", nargs="*", default=sorted(builtin_tasks()))
    options = parser.parse_args()
    lookups = {workflow: told_and_looked_up(workflow) for workflow in LOOKED_UP_IN}
    figures = {task: measured(task) for task in options.tasks}
    for task, stages in figures.items():
        _print(task, stages)
    keep(figures, options.json)
    for workflow, (told, on_demand) in lookups.items():
        _say(
            f"{LOOKED_UP_TASK} with 40 modules, {workflow}: {told:,} tokens told, "
            f"{on_demand:,} looked up; ratio {on_demand / told:.2f}"
        )
    if any(lookups[name][1] > bar * lookups[name][0] for name, bar in LOOKED_UP_BAR.items()):
        return 1
    return (
        0
        if all(
            _ratio(task, figures[task]) <= BAR
            for task in BASELINE
            if task.startswith(WORKSHOP) and task in figures
        )
        else 1
    )


def _total(stages: dict[str, dict[str, int]]) -> int:
    return sum(value for row in stages.values() for key, value in row.items() if key != "requests")


def _ratio(task: str, stages: dict[str, dict[str, int]]) -> float:
    return _total(stages) / BASELINE[task][1]


def _print(task: str, stages: dict[str, dict[str, int]]) -> None:
    head = "".join(f"{name:>14s}" for name in ("requests", *PARTS, "together"))
    _say(f"\n{task:24s}{head}")
    for stage, row in stages.items():
        together = sum(row[part] for part in PARTS)
        cells = "".join(
            f"{value:14,d}" for value in (row["requests"], *(row[p] for p in PARTS), together)
        )
        _say(f"  {stage:22s}{cells}")
    requests = sum(row["requests"] for row in stages.values())
    _say(f"  {'all':22s}{requests:14,d}{'':84s}{_total(stages):14,d}")
    if task in BASELINE:
        before_requests, before = BASELINE[task]
        _say(
            f"  before: {before:,} in {before_requests} requests; ratio {_ratio(task, stages):.2f}"
        )
    if task in PUBLISHED:
        _say("  published mean: {1:,} in {0} requests".format(*PUBLISHED[task]))


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


if __name__ == "__main__":
    sys.exit(main())
