"""What a step's files say of each assumption; the same for a runner and for whoever doubts it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from buildarena_besiege import MachineFileError
from buildarena_besiege.exporting.probes import level_probes
from buildarena_besiege.logs.level_check import GRAVITY_TOLERANCE, GROUND_TOLERANCE
from buildarena_pipeline.evidence.document import Judgement, Verdict, sentence_of
from buildarena_pipeline.evidence.reading_runs import (
    Run,
    StepInputs,
    figures_of,
    log_of,
    root_offsets,
    runs_of,
)
from buildarena_pipeline.evidence.saved_files import saved_differences
from buildarena_pipeline.evidence.trials import Trial, trial_named
from buildarena_simulation import ControllerFailed
from buildarena_simulation.constants import GRAVITY

ROOT_OFF: Final = 0.25
"""How far a block may be from its root in the file, units: what flies or hangs moves a little until
the first sample, and a wrong rule is half a block off."""
LEVEL_OFF: Final = 0.1
PACE: Final = 0.9
LONGEST_PAUSE_S: Final = 3.0
CONTACT_OFF_S: Final = 0.12
REST_OFF: Final = 0.1
WAY_OFF: Final = 0.1
TIPS: Final = 0.2
"""How far the end of a balance sinks or rises until it counts as tipped, units."""
SENSED_OFF: Final = 0.1
UPRIGHT: Final = 0.98
"""The least share of up that points up, on a machine that stands."""
TURNS: Final = 0.5
"""A wheel that is slower does not turn, rad/s."""
SHARE_OFF: Final = 0.1
"""How far half a speed may be from the half, as a share of the whole."""
MAX_NAMED: Final = 8

Shown = dict[str, dict[str, float | None]]
"""Figures by source: "game 1" and so on."""


def judgement(assumption: str, holds: bool | None, seen: str) -> Judgement:
    """A judgement; None for what was not seen."""
    verdict = (
        Verdict.NOT_SEEN if holds is None else Verdict.CONFIRMED if holds else Verdict.CONTRADICTED
    )
    return Judgement(assumption=assumption, verdict=verdict, seen=sentence_of(seen))


def examined(inputs: StepInputs) -> Iterator[Judgement]:
    """Whether every point of an examination is in order."""
    points = inputs.record.points
    wrong = [f"{point.name}: {point.detail}" for point in points if not point.ok]
    seen = "; ".join(wrong) if wrong else f"{len(points)} points in order"
    yield judgement("versions", not wrong if points else None, seen)


def tried(inputs: StepInputs) -> Iterator[Judgement]:
    """Whether the machine of two blocks was played to its end."""
    for record in inputs.record.runs:
        log = log_of(inputs, record.number, record.run_id)
        whole = log.begun and log.ended
        seen = f"{len(log.lines)} lines, from the first to the end"
        yield judgement("places", whole, seen if whole else "the log has no begin or no end")
        return
    yield judgement("places", None, "nothing was played")


def sampled(inputs: StepInputs) -> Iterator[Judgement]:
    """What the game saved of every module type, and where it put them."""
    yield from _saved(inputs)
    yield _roots(inputs, "sampler")


def probed(inputs: StepInputs) -> Iterator[Judgement]:
    """What a machine that stands still measures."""
    runs = runs_of(inputs, "probe")
    world = next((run.world for run in runs if run.world is not None), None)
    if world is None:
        yield judgement("gravity", None, "the log does not tell what the script measured")
        yield judgement("floor", None, "the log does not tell what the script measured")
    else:
        near = abs(-world.gravity - GRAVITY) <= GRAVITY_TOLERANCE * GRAVITY
        yield judgement("gravity", near, f"{-world.gravity:.2f} units/s²")
        yield _floor(world.ground)
    yield _roots(inputs, "probe")
    yield judgement("mass_slider", None, "no function of the mod tells a body's mass")
    yield from _clock(inputs, runs)


def dropped(inputs: StepInputs) -> Iterator[Judgement]:
    """How a cross lands, beside both engines."""
    game = list(step_figures(inputs, "drop").values())
    rests = [values["rest"] for values in game if values["rest"] is not None]
    if not rests:
        why = _faults(runs_of(inputs, "drop"))
        yield judgement("colliders", None, why)
        yield judgement("landing", None, why)
        return
    rest = rests[0]
    yield judgement("colliders", abs(rest - 0.5) <= REST_OFF, f"it rests at {rest:.2f}, not 0.50")
    yield _landing(game[0], inputs)


def weighed(inputs: StepInputs) -> Iterator[Judgement]:
    """Which side of two balances sinks."""
    game = next(iter(step_figures(inputs, "scales").values()), None)
    if game is None:
        yield judgement("masses", None, _faults(runs_of(inputs, "scales")))
        return
    lighter, heavier = game["against_3"] or 0.0, game["against_4"] or 0.0
    seen = f"the log moves by {lighter:+.2f} against three, {heavier:+.2f} against four"
    yield judgement("masses", lighter < -TIPS and heavier > TIPS, seen)


def driven(inputs: StepInputs) -> Iterator[Judgement]:
    """How far wheels come, beside both engines."""
    game = next(iter(step_figures(inputs, "wheels").values()), None)
    if game is None:
        yield judgement("wheels", None, _faults(runs_of(inputs, "wheels")))
        return
    last = list(game)[-1]
    way = game[last] or 0.0
    texts, holds = [f"{way:.1f} units in the game"], None
    for engine, record in inputs.record.engines.items():
        ours = record.figures.get(last)
        if ours is not None:
            texts.append(f"{ours:.1f} in {engine} ({way - ours:+.1f})")
            near = abs(way - ours) <= WAY_OFF * max(abs(ours), 1.0)
            holds = near if holds is None else holds and near
    yield judgement("wheels", holds, ", ".join(texts))


def piloted(inputs: StepInputs) -> Iterator[Judgement]:
    """Whether a program runs, senses and acts as in an engine."""
    run = next(iter(runs_of(inputs, "program")), None)
    piloting = run.trajectory.piloting if run is not None and run.trajectory is not None else None
    if run is None or run.trajectory is None or piloting is None:
        why = _faults(runs_of(inputs, "program"))
        failed = why.startswith(ControllerFailed.BEGINNING)
        yield judgement("program_text", False if failed else None, why)
        for name in ("program_senses", "program_keys", "program_shares"):
            yield judgement(name, None, why)
        return
    yield judgement("program_text", True, f"{len(piloting.answers) - 1} answers are the same here")
    place = [piloting.sense_names.index(f"position.{axis}") for axis in "xyz"]
    away = piloting.senses[:-1, place] - run.trajectory.positions[:-1, 0]
    farthest = float(np.linalg.norm(away, axis=1).max())
    up = float(piloting.senses[:-1, piloting.sense_names.index("up.z")].min())
    seen = f"at most {farthest:.3f} units away; up points up by {up:.3f} at least"
    yield judgement("program_senses", farthest <= SENSED_OFF and up >= UPRIGHT, seen)
    speeds = next(iter(step_figures(inputs, "program").values()))
    whole, half = speeds["whole"] or 0.0, speeds["half"] or 0.0
    seen = f"{whole:.2f} rad/s where all is asked for, {half:.2f} for a half"
    turns = min(whole, half) >= TURNS
    yield judgement("program_keys", turns, seen)
    near = abs(half - whole / 2) <= SHARE_OFF * whole
    yield judgement("program_shares", near if turns else None, seen)


def agreed(inputs: StepInputs, trial_name: str) -> Iterator[Judgement]:
    """Whether both engines give each run of the expert's machine the game's verdict."""
    trial = trial_named(trial_name)
    runs = runs_of(inputs, trial_name)
    game = [values["success"] for values in step_figures(inputs, trial_name).values()]
    engines = {
        engine: record.figures.get("success") for engine, record in inputs.record.engines.items()
    }
    said = {engine: value for engine, value in engines.items() if value is not None}
    if not game:
        yield judgement("agreement", None, _faults(runs))
    else:
        texts = [f"{sum(value == 1 for value in game)} of {len(game)} succeed in the game"]
        texts += [
            f"{name}: {'success' if value == 1 else 'no success'}" for name, value in said.items()
        ]
        same = all(value == mine for value in said.values() for mine in game)
        yield judgement("agreement", same if said else None, "; ".join(texts))
    if trial.scenario.terrain:
        yield _terrain(runs, trial)


def step_figures(inputs: StepInputs, trial_name: str) -> Shown:
    """The figures of each run that its log tells, by "game 1" and so on."""
    trial = trial_named(trial_name)
    return {
        f"game {run.number}": figures_of(trial, run.machine, run.trajectory)
        for run in runs_of(inputs, trial_name)
        if run.machine is not None and run.trajectory is not None
    }


def _saved(inputs: StepInputs) -> Iterator[Judgement]:
    sent, saved = inputs.files.get("machine-1.bsg"), inputs.files.get("saved-1.bsg")
    if sent is None or saved is None:
        for name in ("modules", "entries"):
            yield judgement(name, None, "the game saved no file")
        return
    try:
        differences = saved_differences(sent, saved)
    except MachineFileError as error:
        yield judgement("modules", False, f"what the game saved cannot be read: {error}")
        yield judgement("entries", None, "what the game saved cannot be read")
        return
    counts = [
        f"{one.module}: {one.saved} of {one.sent}" for one in differences if one.saved != one.sent
    ]
    seen = _first(counts) if counts else f"all {len(differences)} types came back"
    yield judgement("modules", not counts, seen)
    changed = [f"{one.module}: {'; '.join(one.changed)}" for one in differences if one.changed]
    added = {key for one in differences for key in one.added}
    seen = _first(changed) if changed else "every entry came back"
    more = f"; {len(added)} entries are the game's own: {_first(sorted(added))}" if added else ""
    yield judgement("entries", not changed, seen + more)


def _roots(inputs: StepInputs, trial_name: str) -> Judgement:
    trial, runs = trial_named(trial_name), runs_of(inputs, trial_name)
    away = [pair for run in runs for pair in root_offsets(run, trial)]
    if not away:
        return judgement("roots", None, _faults(runs))
    wrong = dict.fromkeys(f"{name} {off:.2f} away" for name, off in away if not off <= ROOT_OFF)
    farthest = max(off for _, off in away)
    seen = f"{len(away)} blocks, the farthest {farthest:.3f} units away"
    return judgement("roots", not wrong, _first(list(wrong)) if wrong else seen)


def _floor(ground: tuple[float | str | None, ...]) -> Judgement:
    heights = [height for height in ground if isinstance(height, float)]
    missing = sum(height is None for height in ground)
    if not heights and not missing:
        return judgement("floor", None, "every ray ended on the machine")
    near = not missing and all(abs(height) <= GROUND_TOLERANCE for height in heights)
    span = f"from {min(heights):.2f} to {max(heights):.2f}" if heights else "none ended"
    return judgement(
        "floor",
        near,
        f"{len(heights)} rays {span}" + (f", {missing} in the void" if missing else ""),
    )


def _clock(inputs: StepInputs, runs: list[Run]) -> Iterator[Judgement]:
    for record, run in zip(inputs.record.runs, runs, strict=True):
        pace, copies = record.measured.pace, record.measured
        yield judgement("pace", pace >= PACE, f"{pace:.2f} seconds of the game per second")
        if run.trajectory is None or not copies.copies:
            yield judgement("copies", None, run.fault or "the log was not copied from a window")
            return
        filled = int(run.trajectory.settings.get("filled_samples", 0) or 0)
        fine = filled == 0 and copies.longest_pause_s < LONGEST_PAUSE_S
        seen = (
            f"{copies.copies} copies, the longest in {copies.longest_copy_s:.2f} s, at most "
            f"{copies.longest_pause_s:.2f} s apart; {filled} samples are missing"
        )
        yield judgement("copies", fine, seen)
        return
    yield judgement("pace", None, "nothing was played")
    yield judgement("copies", None, "nothing was played")


def _landing(game: Mapping[str, float | None], inputs: StepInputs) -> Judgement:
    contact, rest = game["contact_s"], game["rest"]
    texts, holds = [f"contact at {_seconds(contact)}, rest at {_units(rest)} in the game"], None
    for engine, record in inputs.record.engines.items():
        ours, at_rest = record.figures.get("contact_s"), record.figures.get("rest")
        if None in (ours, at_rest, contact, rest):
            continue
        late, higher = (contact or 0.0) - (ours or 0.0), (rest or 0.0) - (at_rest or 0.0)
        texts.append(f"{engine}: {late:+.2f} s, {higher:+.2f}")
        near = abs(late) <= CONTACT_OFF_S and abs(higher) <= REST_OFF
        holds = near if holds is None else holds and near
    return judgement("landing", holds, "; ".join(texts))


def _terrain(runs: list[Run], trial: Trial) -> Judgement:
    probes = level_probes(trial.scenario)
    for run in runs:
        world = run.world
        if world is None or len(world.ground) != len(probes):
            continue
        off = [
            height - probe.height
            for probe, height in zip(probes, world.ground, strict=True)
            if probe.height > 0.0 and isinstance(height, float)
        ]
        if off:
            worst = max(off, key=abs)
            seen = f"{len(off)} rays end at most {worst:+.2f} beside the height of the file"
            return judgement("level_origin", abs(worst) <= LEVEL_OFF, seen)
    return judgement("level_origin", None, "no ray ended on terrain")


def _faults(runs: list[Run]) -> str:
    return next((run.fault for run in runs if run.fault), "nothing was played")


def _first(texts: list[str]) -> str:
    more = f" and {len(texts) - MAX_NAMED} more" if len(texts) > MAX_NAMED else ""
    return "; ".join(texts[:MAX_NAMED]) + more


def _seconds(value: float | None) -> str:
    return "no time" if value is None else f"{value:.2f} s"


def _units(value: float | None) -> str:
    return "no height" if value is None else f"{value:.2f}"
