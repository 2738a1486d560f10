"""The replay of a transcript: of agents' sessions, and of sessions under way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, Final

from buildarena_backend.agents.workbench import TEST, Workbench
from buildarena_backend.replays.chapters import Chapter, Kind, Recorder, Replay, Turn, refused_step
from buildarena_benchmark import Task
from buildarena_benchmark.environment import ASSEMBLY
from buildarena_benchmark.environment.tools import OBJECTION
from buildarena_geometry import Catalogue, Machine, RefusalClass
from buildarena_geometry.modules.sets import modules_of_action, smallest_set

EXTERNAL: Final = "external"
PLAN: Final = "plan"
BUILD: Final = "build"
REFINE: Final = "refine"
ASSEMBLE: Final = "assemble"
NO_BUILDING: Final = frozenset({PLAN, "draft", "control", "analyse", "inspect"})
"""Phases in which no machine is built; an analyst and an inspector only look at one."""
BEFORE_THE_MACHINE: Final = frozenset({"parallel_calls", "unknown_action"})
"""Refusals of the session, which the machine never heard of."""


def replay_of_turns(turns: Sequence[Turn], task: Task | None = None) -> Replay:
    """Return the construction that a transcript's actions repeat.

    Of a session in several rounds it contains the last one. What a controller programs is not an
    action, so it is left out.

    Args:
        task: The job's, drawn by its seed: it may give the machine that is built on.
    """
    if turns and turns[0]["stage"] == EXTERNAL:
        return _replay_of_calls(turns, task)
    session = _Session(_catalogue_of(turns), task)
    for (phase, part), dialogue in groupby(turns, key=place):
        session.play(phase, part, list(dialogue))
    return Replay(
        chapters=list(session.chapters.values()),
        machine=session.machine,
        complete=session.recorder.complete,
    )


def place(turn: Turn) -> tuple[str, str | None]:
    """Return the key of a dialogue: phase and sub-structure."""
    return (turn["stage"], turn.get("sub_structure"))


def _is_refused_by_session(action: Mapping[str, Any], task: Task | None) -> bool:
    """Return whether the session refused an action, or may have, by its task's edits."""
    has_initial_machine = task is not None and task.initial_machine is not None
    return not action["ok"] and (has_initial_machine or action["reason"] in BEFORE_THE_MACHINE)


def _catalogue_of(turns: Sequence[Turn]) -> Catalogue:
    """Return the smallest set with the modules that a transcript's actions name and were given."""
    actions = [action for turn in turns for action in turn["actions"]]
    usable = [action for action in actions if action["reason"] != RefusalClass.MODULE_RESTRICTION]
    return smallest_set(
        module.name
        for action in usable
        if isinstance(action["arguments"], Mapping)
        for module in modules_of_action(action["arguments"])
    )


def _replay_of_calls(turns: Sequence[Turn], task: Task | None) -> Replay:
    """Return the replay of an agent's machines, each in its own chapter."""
    bench = Workbench(_catalogue_of(turns), on_demand=True, task=task)
    recorder, chapters = Recorder(), dict[str, Chapter]()
    for turn in turns:
        name = str(turn["sub_structure"])
        if name not in chapters:
            kind: Kind = "assembly" if name == ASSEMBLY else "sub_structure"
            chapters[name] = Chapter(name=name, kind=kind, machine=bench.machine(name))
        for action in turn["actions"]:
            if action["name"] == TEST and action["ok"]:
                continue
            if _is_refused_by_session(action, task):
                chapters[name].steps.append(refused_step(turn["index"], action))
                continue
            recorder.record(chapters[name], turn["index"], action["name"], action["arguments"])
    if len(chapters) == 1:
        next(iter(chapters.values())).kind = "machine"
    chosen = bench.result()
    return Replay(
        chapters=list(chapters.values()),
        machine=None if chosen is None else chosen[1],
        complete=recorder.complete,
    )


class _Session:
    """The machines of a model's session, dialogue by dialogue."""

    def __init__(self, catalogue: Catalogue, task: Task | None) -> None:
        self._catalogue = catalogue
        self._task = task
        self.chapters: dict[str, Chapter] = {}
        self.recorder = Recorder()
        self.machine: Machine | None = None
        self._machines: dict[str, Machine] = {}

    def play(self, phase: str, part: str | None, turns: Sequence[Turn]) -> None:
        """Do the actions of a dialogue again."""
        if phase == PLAN:
            self._begin_round()
        if phase in NO_BUILDING:
            return
        chapter = self._chapter(phase, part)
        before = chapter.machine
        if phase == REFINE:
            # A correction that is given up leaves the machine as it was.
            chapter.machine = before.copy()
        given_up = False
        for turn in turns:
            for action in turn["actions"]:
                given_up = given_up or (action["name"] == OBJECTION.name and action["ok"])
                self._act(chapter, turn["index"], action)
        if phase == REFINE and given_up:
            chapter.machine = before
        if phase != ASSEMBLE:
            self._machines[chapter.name] = chapter.machine
        self.machine = chapter.machine

    def _begin_round(self) -> None:
        self.chapters.clear()
        self._machines.clear()
        self.machine = None

    def _chapter(self, phase: str, part: str | None) -> Chapter:
        name = ASSEMBLY if phase == ASSEMBLE else part or "machine"
        if phase == BUILD and name in self.chapters:
            self._begin_round()
        chapter = self.chapters.get(name)
        if chapter is not None:
            return chapter
        if phase == ASSEMBLE:
            new = Chapter(name=name, kind="assembly", machine=self._empty(self._machines))
        else:
            kind: Kind = "machine" if part is None else "sub_structure"
            new = Chapter(name=name, kind=kind, machine=self._empty())
        self.chapters[name] = new
        return new

    def _act(self, chapter: Chapter, turn: int, action: Mapping[str, Any]) -> None:
        if action["name"] == OBJECTION.name:
            return
        if _is_refused_by_session(action, self._task):
            chapter.steps.append(refused_step(turn, action))
            return
        if action["ok"] and chapter.kind == "machine" and self._is_anew(chapter, action):
            # Where one role builds alone, nothing separates two rounds.
            chapter.steps.clear()
            chapter.machine = self._empty()
        self.recorder.record(chapter, turn, action["name"], action["arguments"])

    def _empty(self, available: Mapping[str, Machine] | None = None) -> Machine:
        if available is None and self._task is not None:
            return self._task.new_machine(self._catalogue)
        return Machine(catalogue=self._catalogue, available=available)

    def _is_anew(self, chapter: Chapter, action: Mapping[str, Any]) -> bool:
        return chapter.machine.started and str(action["name"]).lower() == "start"
