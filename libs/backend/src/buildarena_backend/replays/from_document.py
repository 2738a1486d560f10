"""The replay of a logged machine: its own log, with the turns of the transcript."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from itertools import groupby
from typing import Any, Final

from buildarena_backend.replays.chapters import Chapter, Recorder, Replay, Turn, refused_step
from buildarena_backend.replays.from_turns import ASSEMBLE, BUILD, REFINE, place
from buildarena_benchmark.environment import ASSEMBLY
from buildarena_benchmark.environment.tools import OBJECTION
from buildarena_geometry import Machine
from buildarena_geometry.documents.log import LoggedState

CONTROL: Final = "control"
LOOKING: Final = ("get_", "review_")
"""Prefixes of actions that change nothing."""
PROGRAMMED: Final = frozenset({"add_control_key", "add_control_sequence"})
"""Actions that store a controller's program, which is text and not an action."""

TurnAction = tuple[int, Mapping[str, Any]]
"""An action of the transcript with its turn."""


def replay_of_log(built: Machine, turns: Sequence[Turn]) -> Replay:
    """Return a machine's construction from its own log.

    Args:
        turns: The job's transcript.
    """
    logged = built.log
    offered = logged.state.catalogue
    recorder = Recorder()
    chapters: dict[str, Chapter] = {}
    for name, part_log in logged.available.items():
        chapter = Chapter(name=name, kind="sub_structure", machine=Machine(catalogue=offered))
        chapters[name] = _replay(recorder, chapter, part_log, _of_part(turns, name))
    if logged.available:
        machines = {name: chapter.machine for name, chapter in chapters.items()}
        last = Chapter(
            name=ASSEMBLY, kind="assembly", machine=Machine(catalogue=offered, available=machines)
        )
        _replay(recorder, last, logged, _of_assembly(turns))
    else:
        building = [turn for turn in turns if turn["stage"] == BUILD]
        part = building[-1].get("sub_structure") if building else None
        last = Chapter(name=part or "machine", kind="machine", machine=Machine(catalogue=offered))
        _replay(recorder, last, logged, _of_part(turns, part))
    _name_controller(last, turns)
    return Replay(
        chapters=[*chapters.values(), last], machine=last.machine, complete=recorder.complete
    )


def _replay(
    recorder: Recorder, chapter: Chapter, logged: LoggedState, actions: Sequence[TurnAction]
) -> Chapter:
    """Return a repetition of a machine's log, each action with the turn that requested it."""
    logged_keys = [
        _key(action["name"], action["arguments"], None if action["ok"] else action["reason"])
        for _, action in actions
    ]
    records = logged.records
    done = [_key(record.name, record.arguments, record.reason) for record in records]
    for tag, start, end, first, last in SequenceMatcher(None, logged_keys, done).get_opcodes():
        if tag == "equal":
            for (turn, _), record in zip(actions[start:end], records[first:last], strict=True):
                recorder.record(chapter, turn, record.name, record.arguments)
            continue
        chapter.steps += [
            refused_step(turn, action)
            for turn, action in actions[start:end]
            if not action["ok"] and action["name"] != OBJECTION.name
        ]
        for record in records[first:last]:
            recorder.record(chapter, None, record.name, record.arguments)
    # Lookups of the session for the next phase's opening message are not steps of the machine.
    chapter.steps = [
        step
        for step in chapter.steps
        if step.turn is not None or not step.accepted or not step.action.startswith(LOOKING)
    ]
    return chapter


def _of_part(turns: Sequence[Turn], name: str | None) -> list[TurnAction]:
    """Return the actions of a part's last dialogue of building, and of those that corrected it."""
    actions: list[TurnAction] = []
    for (phase, part), dialogue in groupby(turns, key=place):
        if part != name:
            continue
        if phase == BUILD:
            actions = _actions(list(dialogue))
        elif phase == REFINE:
            actions += _actions(list(dialogue))
    return actions


def _of_assembly(turns: Sequence[Turn]) -> list[TurnAction]:
    actions: list[TurnAction] = []
    for (phase, _), dialogue in groupby(turns, key=place):
        if phase == ASSEMBLE:
            actions = _actions(list(dialogue))
    return actions


def _actions(turns: Sequence[Turn]) -> list[TurnAction]:
    return [(turn["index"], action) for turn in turns for action in turn["actions"]]


def _key(name: str, arguments: object, reason: object) -> str:
    values = {} if arguments is None else arguments
    return json.dumps([name, values, reason], sort_keys=True)


def _name_controller(chapter: Chapter, turns: Sequence[Turn]) -> None:
    """Give the key presses of a program the turn in which the controller wrote it."""
    turn_numbers = [turn["index"] for turn in turns if turn["stage"] == CONTROL]
    if turn_numbers:
        chapter.steps = [
            replace(step, turn=turn_numbers[-1])
            if step.turn is None and step.action in PROGRAMMED
            else step
            for step in chapter.steps
        ]
