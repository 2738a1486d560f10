"""Scorers' thresholds of mechanisms and flight, and what makes such a task hopeless."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.tasks.fields import Count, Document, Threshold
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import ReleasedPlacement

MarkName = Annotated[str, Field(min_length=1, max_length=40)]


class RoadScoring(Document):
    """How far, and how gently, a vehicle carries a cargo over a rough road northwards.

    Attributes:
        min_distance: The distance must exceed it, units.
        max_rms: The root mean square of the cargo's vertical acceleration must lie below it, g.
        max_shift: Farthest that the cargo may get from its place on the machine, units.
        settle_s: When the cargo's place is taken, and accelerations begin to count, seconds.
        half_width: Of the road about x = 0, units; beyond it nothing counts any more.
        length: Of the road: farther distances count as this, units.
    """

    name: Literal["road"]
    min_distance: Threshold = 30.0
    max_rms: Threshold = 1.0
    max_shift: Threshold = 1.5
    settle_s: Threshold = 2.0
    half_width: Threshold = 15.0
    length: Threshold = 36.0


class SlalomScoring(Document):
    """How many gates a vehicle passes in order.

    Attributes:
        min_gates: Fewest gates of a trial that passes.
    """

    name: Literal["slalom"]
    min_gates: Count = 4


class WinchScoring(Document):
    """How high a cargo is raised and held when no key is pressed any more.

    Attributes:
        min_rise: The height held, above where the cargo stood, must be no less, units.
        hold_s: For how long it must be held, seconds.
        max_play: How far the height may vary meanwhile, up or down, units.
    """

    name: Literal["winch"]
    min_rise: Threshold = 5.0
    hold_s: Annotated[float, Field(gt=0, le=600)] = 5.0
    max_play: Threshold = 0.3


class PlaceScoring(Document):
    """How near to a mark a cargo is put down.

    Attributes:
        mark: Name of the mark in the scenario.
        max_distance: Farthest from the mark that the cargo may rest, units.
        min_carry: Least horizontal distance from where the cargo stood, units.
        clearance: Least height of the cargo's underside halfway between its place and the mark,
            units.
        rest_s: How long it must be at rest at the end, seconds.
        max_speed: While it rests it is slower, units/s.
        max_base_shift: The starting block must stay nearer to where it was, units.
        max_loose: Farthest that the cargo may move, in all, while the machine does not bear it,
            units.
    """

    name: Literal["place"]
    mark: MarkName = "goal"
    max_distance: Threshold = 1.0
    min_carry: Threshold = 6.0
    clearance: Threshold = 2.0
    rest_s: Annotated[float, Field(gt=0, le=600)] = 2.0
    max_speed: Threshold = 0.1
    max_base_shift: Threshold = 0.5
    max_loose: Threshold = 1.5


class HoverScoring(Document):
    """How long a machine holds a height with its cargo.

    Attributes:
        height: Of the starting block's centre, units.
        band: How far it may be above or below, units.
        hold_s: For how long in a row, seconds.
        max_tilt_deg: Of the starting block against how it stood at the start, degrees.
        max_drift: Horizontal distance of the starting block from its start, units.
    """

    name: Literal["hover"]
    height: Threshold = 10.0
    band: Threshold = 1.5
    hold_s: Annotated[float, Field(gt=0, le=600)] = 8.0
    max_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    max_drift: Threshold = 5.0


class GlideScoring(Document):
    """How far a machine that is let go in the air flies, and how gently it lands.

    Attributes:
        min_range: The horizontal distance to where it lands must exceed it, units.
        max_sink: It must be falling more slowly when it lands, units/s.
    """

    name: Literal["glide"]
    min_range: Threshold = 80.0
    max_sink: Threshold = 6.0


WorkshopScoring = (
    RoadScoring | SlalomScoring | WinchScoring | PlaceScoring | HoverScoring | GlideScoring
)


def hopeless(scoring: WorkshopScoring, scenario: Scenario) -> str | None:
    """Why no machine can pass: the scorer asks for what the scenario does not have."""
    problem = _lacking(scoring, scenario)
    driven = isinstance(scoring, RoadScoring | SlalomScoring | WinchScoring | PlaceScoring)
    if problem is None and driven and scenario.control.mode != "agent":
        return "nobody presses a key: scenario.control.mode must be agent"
    return problem


def _lacking(scoring: WorkshopScoring, scenario: Scenario) -> str | None:
    match scoring:
        case RoadScoring():
            return _hopeless_road(scoring, scenario)
        case SlalomScoring():
            return _hopeless_slalom(scoring, scenario)
        case WinchScoring():
            return _hopeless_winch(scoring, scenario)
        case PlaceScoring():
            return _hopeless_place(scoring, scenario)
        case HoverScoring():
            return _hopeless_hover(scoring, scenario)
        case GlideScoring():
            return _hopeless_glide(scenario)


def _hopeless_road(scoring: RoadScoring, scenario: Scenario) -> str | None:
    if scenario.cargo is None:
        return "the cargo is judged, but scenario has no cargo"
    if scoring.settle_s >= scenario.duration_s:
        return f"settle_s {scoring.settle_s:g} is not within the trial"
    if scoring.length <= scoring.min_distance:
        return f"the road's length {scoring.length:g} does not exceed min_distance"
    return None


def _hopeless_slalom(scoring: SlalomScoring, scenario: Scenario) -> str | None:
    count = len(scenario.gates)
    if not count or count < scoring.min_gates:
        return f"{scoring.min_gates} gates are asked for, but scenario.gates has {count}"
    return None


def _hopeless_winch(scoring: WinchScoring, scenario: Scenario) -> str | None:
    if scenario.cargo is None or scenario.cargo.at is None:
        return "the cargo is raised from its place, but scenario.cargo has no place: give cargo.at"
    end_s = scenario.control.until_s
    if end_s is None or end_s + scoring.hold_s > scenario.duration_s:
        return (
            f"the cargo is held for {scoring.hold_s:g} s without keys: scenario.control.until_s "
            "must be as long before the trial's end"
        )
    return None


def _hopeless_place(scoring: PlaceScoring, scenario: Scenario) -> str | None:
    if scenario.cargo is None or scenario.cargo.at is None:
        return "the cargo is carried from its place, but scenario.cargo has none: give cargo.at"
    marks = {mark.name: mark for mark in scenario.marks}
    if scoring.mark not in marks:
        known = ", ".join(marks) or "none"
        return f"there is no mark {scoring.mark!r} in scenario.marks: there are {known}"
    way = np.subtract(marks[scoring.mark].center[:2], scenario.cargo.at[:2])
    if np.linalg.norm(way) + scoring.max_distance < scoring.min_carry:
        return f"the mark is nearer to the cargo than min_carry {scoring.min_carry:g}"
    if scoring.rest_s >= scenario.duration_s:
        return f"rest_s {scoring.rest_s:g} is longer than the trial"
    return None


def _hopeless_hover(scoring: HoverScoring, scenario: Scenario) -> str | None:
    if scenario.cargo is None:
        return "the cargo is carried, but scenario has no cargo"
    if scoring.hold_s > scenario.duration_s:
        return f"hold_s {scoring.hold_s:g} is longer than the trial"
    return None


def _hopeless_glide(scenario: Scenario) -> str | None:
    if not isinstance(scenario.placement, ReleasedPlacement):
        return "a glider is judged, but scenario.placement.kind is not released"
    return None
