"""Interface of scorers: parameters, the rule, and the flags they may raise."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.fields import Document
from buildarena_benchmark.scoring.flags import FORCES_NOT_MEASURED, Flag
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_simulation import Scenario
from buildarena_simulation.trial import Decision

Metric = float | int | bool | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Deciding:
    """Deciding bodies and interval of a trial.

    Attributes:
        samples: Number of samples examined, from the first on.
        members: (T, N) bool, the tracked blocks whose motion decides.
        cargo: Whether the cargo's motion decides, too.
    """

    samples: int
    members: NDArray[np.bool_]
    cargo: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Score of one trial of one machine.

    Attributes:
        success: Whether the task's criterion is met.
        indicator: The task's figure; see `Task.indicator`.
        metrics: Parts, mass, cost and the category's secondary metrics; None for a missing one.
        flags: Remarks on it; see `buildarena_benchmark.flags`.
    """

    success: bool
    indicator: float
    metrics: Mapping[str, Any]
    flags: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A scorer's finding; fields as in `Score`, metrics without the machine's own.

    Attributes:
        metrics: The category's secondary metrics.
        deciding: None where all bodies decide, to the end.
    """

    success: bool
    indicator: float
    metrics: Mapping[str, Metric] = field(default_factory=dict)
    flags: tuple[Flag, ...] = ()
    deciding: Deciding | None = None


def _none(scoring: Any, scenario: Scenario) -> None:
    """Return None: machines can pass, or only they bound the indicator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scorer:
    """A way to judge a trial, under the name that task files give.

    Attributes:
        parameters: Type of a task file's `scoring`; its field `name` is a literal, the scorer's
            name.
        judge: Called with the parameters and the run.
        explain: Called with the parameters, the scenario and the score: what happened, when and by
            how much it missed, in one sentence for builders and visitors of pages.
        infeasible: Called with parameters and scenario: why no machine can pass, because the
            scenario lacks something that the scorer needs; None if machines can, by default.
        flags: All flags of `judge`, in the order in which they are documented; where it needs
            forces, `FORCES_NOT_MEASURED` is added.
        needs: What `judge` reads: forces of contacts, those and the cargo, or no more than places.
        decision: Called with parameters and scenario: a test whether a running trial is decided;
            None where the whole trial decides.
        ceiling: Called with parameters and scenario: the greatest possible indicator, or an upper
            bound; None where only the machine bounds it.
    """

    parameters: type[Document]
    judge: Callable[[Any, Run], Verdict]
    explain: Callable[[Any, Scenario, Score], str]
    infeasible: Callable[[Any, Scenario], str | None] = _none
    flags: tuple[Flag, ...] = ()
    needs: Literal["places", "forces", "cargo"] = "forces"
    decision: "Callable[[Any, Scenario], Decision] | None" = None
    ceiling: Callable[[Any, Scenario], float | None] = _none

    def __post_init__(self) -> None:
        """Add the flag of runs that lack what is read."""
        if self.needs != "places" and FORCES_NOT_MEASURED not in self.flags:
            object.__setattr__(self, "flags", (*self.flags, FORCES_NOT_MEASURED))

    def verdict(self, scoring: Any, run: Run) -> Verdict:
        """Judge a run; one that lacks what the scorer reads is a failure, with a flag."""
        lacks_forces = self.needs != "places" and run.trajectory.bearing is None
        if lacks_forces or (self.needs == "cargo" and run.trajectory.cargo_position is None):
            return Verdict(success=False, indicator=0.0, flags=(FORCES_NOT_MEASURED,))
        return self.judge(scoring, run)

    @property
    def name(self) -> str:
        """The parameters' literal name."""
        (name,) = self.parameters.model_fields["name"].annotation.__args__  # type: ignore[union-attr]  # a Literal
        return str(name)

    @property
    def description(self) -> str:
        """Its indicator in one sentence."""
        measured = (self.judge.__doc__ or "").partition("\n")[0]
        return f"The indicator is {measured.removeprefix('Measure ')}"


def final_mass(scoring: Any, scenario: Scenario) -> float | None:
    """Return the ceiling of an indicator that is the mass of a growing cargo."""
    return None if scenario.cargo is None else scenario.cargo.final_mass


def undriven(scenario: Scenario) -> str | None:
    """Return why a machine that is moved by keys cannot pass: no key is pressed."""
    if scenario.control.mode == "agent":
        return None
    return "no key is pressed: scenario.control.mode must be agent"


def raised(flags: Mapping[Flag, bool]) -> tuple[Flag, ...]:
    """Return the flags with a true condition."""
    return tuple(flag for flag, holds in flags.items() if holds)


def rounded(value: float) -> float:
    """Return a metric to six decimals, so that scores compare equal across machines."""
    return round(float(value), 6) + 0.0  # no -0.0


def judged(
    run: Run,
    *,
    success: bool,
    indicator: float,
    metrics: Mapping[str, Metric],
    samples: int,
    flags: Mapping[Flag, bool] = MappingProxyType({}),
    cargo: bool = False,
) -> Verdict:
    """Return a verdict that what is joined to the starting block decides; figures are rounded.

    Args:
        metrics: The secondary metrics; broken joints are added.
        samples: See `Deciding`, like `cargo`.
        flags: Flags, and whether they are raised.
    """
    figures = {name: rounded(v) if isinstance(v, float) else v for name, v in metrics.items()}
    return Verdict(
        success=success,
        indicator=rounded(indicator),
        metrics={**figures, "broken_joints": len(run.trajectory.breaks)},
        flags=raised(flags),
        deciding=Deciding(samples=samples, members=run.joined, cargo=cargo),
    )
