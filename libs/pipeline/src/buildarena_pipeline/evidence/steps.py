"""The steps of a first evening with the game: one registry, for playing, judging and showing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Final, Literal

from buildarena_benchmark import builtin_tasks, paper_tasks
from buildarena_besiege import BesiegeError
from buildarena_pipeline.evidence.document import (
    EvidenceError,
    Judgement,
    StepRecord,
    Verdict,
    sentence_of,
)
from buildarena_pipeline.evidence.judging import (
    agreed,
    driven,
    dropped,
    examined,
    judgement,
    piloted,
    probed,
    sampled,
    step_figures,
    tried,
    weighed,
)
from buildarena_pipeline.evidence.reading_runs import StepInputs

Way = Literal["examine", "try", "play", "save"]
Judge = Callable[[StepInputs], Iterable[Judgement]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One step.

    Attributes:
        name: What ``--steps`` calls it.
        title: What it does, in words.
        assumes: Names of the assumptions that it is about.
        judge: What its files say of them.
        way: How it is done: the machine is examined, the calibration is tried, a trial is played,
            or a trial is played whose machine the game saves first.
        trial: What is played; "" where nothing of ours is.
        repeated: Whether it is played as often as asked for, rather than once.
        window: Whether it needs the game's window.
        beside_engines: Whether our engines simulate the same trial.
    """

    name: str
    title: str
    assumes: tuple[str, ...]
    judge: Judge
    way: Way = "play"
    trial: str = ""
    repeated: bool = False
    window: bool = False
    beside_engines: bool = False


def _expert(task: str) -> Step:
    terrain = ("level_origin",) if builtin_tasks()[task].scenario.terrain else ()
    return Step(
        name=f"expert-{task}",
        title=f"The expert's machine in {task}, beside both engines",
        assumes=("agreement", *terrain),
        judge=partial(agreed, trial_name=task),
        trial=task,
        repeated=True,
        beside_engines=True,
    )


_STEPS: Final = (
    Step(
        name="doctor",
        title="What is installed, and whether it can be played",
        assumes=("versions",),
        judge=examined,
        way="examine",
    ),
    Step(
        name="calibration",
        title="Two blocks by the calibrated places, with pictures",
        assumes=("places",),
        judge=tried,
        way="try",
        window=True,
    ),
    Step(
        name="sampler",
        title="Every module type: loaded, saved by the game, compared",
        assumes=("modules", "entries", "roots"),
        judge=sampled,
        way="save",
        trial="sampler",
        window=True,
    ),
    Step(
        name="probe",
        title="20 s of standing still: gravity, rays, axes, copies, pace",
        assumes=("gravity", "floor", "roots", "mass_slider", "pace", "copies"),
        judge=probed,
        trial="probe",
        window=True,
    ),
    Step(
        name="drop",
        title="A cross falls from 10 units, beside both engines",
        assumes=("colliders", "landing"),
        judge=dropped,
        trial="drop",
        beside_engines=True,
    ),
    Step(
        name="scales",
        title="Two balances: a log against three and four wooden blocks, beside both engines",
        assumes=("masses",),
        judge=weighed,
        trial="scales",
        beside_engines=True,
    ),
    Step(
        name="wheels",
        title="Four wheels drive for five seconds, beside both engines",
        assumes=("wheels",),
        judge=driven,
        trial="wheels",
        beside_engines=True,
    ),
    Step(
        name="program",
        title="A program turns two wheels, one at half speed, beside both engines",
        assumes=("program_text", "program_senses", "program_keys", "program_shares"),
        judge=piloted,
        trial="program",
        window=True,
        beside_engines=True,
    ),
    *map(_expert, paper_tasks()),
)

STEPS: Final[Mapping[str, Step]] = MappingProxyType({step.name: step for step in _STEPS})
"""Every step by its name, in the order of playing."""


def step_named(name: str) -> Step:
    """A step by its name.

    Raises:
        EvidenceError: There is none of this name; the message has the names.
    """
    step = STEPS.get(name)
    if step is None:
        raise EvidenceError(f"there is no step {name[:60]!r}; there are {', '.join(STEPS)}")
    return step


def _explained(entry: Judgement, record: StepRecord) -> Judgement:
    """Where a step failed, why something was not seen is why it failed."""
    if entry.verdict is Verdict.NOT_SEEN and record.detail:
        return entry.model_copy(update={"seen": record.detail})
    return entry


def judged(inputs: StepInputs) -> StepRecord:
    """A step's record with what its files say: figures and verdicts are found, never taken over.

    Judgements that the record has and its files do not bear out are marked with what they were.

    Raises:
        EvidenceError: There is no such step.
    """
    step, record = step_named(inputs.record.name), inputs.record
    stated = {entry.assumption: entry.verdict for entry in record.judgements}
    engines = {engine: dict(entry.figures) for engine, entry in record.engines.items()}
    try:
        judgements = [_explained(entry, record) for entry in step.judge(inputs)]
        games = step_figures(inputs, step.trial) if step.beside_engines else {}
    except (BesiegeError, ValueError, ArithmeticError, LookupError) as error:
        why = sentence_of(f"its files cannot be judged: {error}")
        judgements = [judgement(name, None, why) for name in step.assumes]
        games = {}
    marked = [
        entry.model_copy(update={"stated": stated[entry.assumption]})
        if stated.get(entry.assumption, entry.verdict) != entry.verdict
        else entry
        for entry in judgements
    ]
    return record.model_copy(update={"judgements": tuple(marked), "figures": {**games, **engines}})
