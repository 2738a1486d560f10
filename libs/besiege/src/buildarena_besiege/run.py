"""A machine prepared for one trial in the game."""

from __future__ import annotations

import re
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.exporting.header import header_lines
from buildarena_besiege.exporting.level import level_file
from buildarena_besiege.exporting.machine_file import (
    BlockRecord,
    CargoBox,
    Guids,
    block_records,
    machine_text,
)
from buildarena_besiege.exporting.pilot import pilot_lua
from buildarena_besiege.exporting.probes import level_probes, ray_start
from buildarena_besiege.exporting.script import (
    FIRST_BLOCK,
    Reported,
    Telling,
    reference_lua,
    script_text,
)
from buildarena_besiege.keys import (
    UPDATES_PER_S,
    bindings_of,
    bound_presses,
    cannons,
    channel_keys,
    firing_edges,
    key_edges,
)
from buildarena_besiege.names import CARGO_ID
from buildarena_besiege.placement import AS_BUILT, GlobalPose, cargo_root, global_pose
from buildarena_besiege.tracking import begin_fields, tracked_blocks
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Scenario
from buildarena_simulation.constants import GRAVITY, MAX_PARTS
from buildarena_simulation.scenario import GroundPlacement, ReleasedPlacement, SpanPlacement

_NAME: Final = re.compile(r"[a-z0-9_-]{1,100}")
_LONGEST_RUN_ID: Final = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class GameRun:
    """A machine prepared for one trial in the game.

    Attributes:
        name: Stem of the machine file, which is typed into the load dialog.
        run_id: Part of every line of the log.
        machine_file: The .bsg with the script inside.
        script: The same Lua script as text.
        tracked: Ids of the blocks that the script reports, without the cargo.
        duration_s: Length of the trial by the script's own time, seconds.
        set_ground: True if "set ground" must be clicked before the start.
        level: Level to open (.blv); None for the flat sandbox.
    """

    name: str
    run_id: str
    machine_file: bytes
    script: str
    tracked: tuple[str, ...]
    duration_s: float
    set_ground: bool
    level: bytes | None
    scenario: Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedMachine:
    """A machine file before it is written.

    Attributes:
        pose: Pose of the machine in the game.
        records: Blocks of the file.
        tracked: Ids of the blocks that the script reports, without the cargo.
        piloted: True if the machine's program acts in place of keys.
    """

    pose: GlobalPose
    records: tuple[BlockRecord, ...]
    script: str
    tracked: tuple[str, ...] = ()
    piloted: bool = False


def prepare_run(
    machine: Machine,
    scenario: Scenario,
    *,
    name: str,
    run_id: str,
    controls: Sequence[KeyPress] | None = None,
    new_guid: Callable[[], uuid.UUID] = uuid.uuid4,
) -> GameRun:
    """Prepare a machine for a trial in the game.

    Args:
        scenario: Scenario, which determines everything about the run.
        name: Stem of the machine file: lower case letters, digits, "-" and "_".
        run_id: Id of the run; part of every line of the log.
        controls: Control sequence. Defaults to the machine's own.
        new_guid: Generator of the blocks' guids.

    Raises:
        MachineNotPlayableError: The game cannot load the machine, or run the scenario.
        ControllerFailed: The machine's program is invalid, or the scenario allows none.
        ValueError: The name or the run's id is invalid.
    """
    _require_name(name)
    _require_run_id(run_id)
    _require_sayable(machine, scenario)
    prepared = prepared_machine(
        machine, scenario, run_id=run_id, controls=controls, new_guid=new_guid
    )
    text = machine_text(name, prepared.pose, prepared.records, prepared.script)
    return GameRun(
        name=name,
        run_id=run_id,
        machine_file=text.encode("utf-8"),
        script=prepared.script,
        tracked=prepared.tracked,
        duration_s=scenario.duration_s,
        set_ground=not isinstance(scenario.placement, SpanPlacement),
        level=level_file(scenario) if scenario.terrain else None,
        scenario=scenario,
    )


def plain_machine_file(
    machine: Machine,
    *,
    name: str,
    controls: Sequence[KeyPress] | None = None,
    new_guid: Callable[[], uuid.UUID] = uuid.uuid4,
) -> bytes:
    """Return the file of a machine as built, without a trial; its keys play by themselves.

    Args:
        name: Stem of the file name.
        controls: Control sequence. Defaults to the machine's own.
        new_guid: Generator of the blocks' guids.

    Raises:
        MachineNotPlayableError: The game cannot load the machine.
        ValueError: The name is invalid.
    """
    _require_name(name)
    _require_playable(machine)
    if machine.controller:
        raise MachineNotPlayableError(
            "a program acts in a task's trial alone, whose senses it is told: name a task"
        )
    presses = tuple(machine.control_sequence if controls is None else controls)
    keys = bindings_of(machine, None)
    edges = key_edges(bound_presses(presses, machine))
    records = block_records(machine, Guids(new_guid), keys=keys)
    header = header_lines(machine, records, presses, plain=True)
    script = script_text(header, edges, cargo=None, cargo_reference="", telling=None)
    return machine_text(name, AS_BUILT, records, script).encode("utf-8")


def prepared_machine(
    machine: Machine,
    scenario: Scenario | None,
    *,
    run_id: str = "",
    controls: Sequence[KeyPress] | None = None,
    new_guid: Callable[[], uuid.UUID] = uuid.uuid4,
) -> PreparedMachine:
    """Prepare a machine file; arguments as in `prepare_run`, None for no trial."""
    _require_playable(machine)
    presses = tuple(machine.control_sequence if controls is None else controls)
    control = None if scenario is None else scenario.control
    effective = bound_presses(presses, machine)
    piloted = scenario is not None and bool(machine.controller) and controls is None
    played = effective if control is None or control.mode == "agent" else ()
    if piloted:
        played = ()
    edges = key_edges(played)
    if control is not None and control.mode == "constant":
        edges = firing_edges(machine, control)
    box = None
    if scenario is not None and scenario.cargo is not None:
        root = cargo_root(machine, scenario.cargo.drop_height)
        box = CargoBox(size=scenario.cargo.size, root=root)
    keys = channel_keys(machine) if piloted else bindings_of(machine, control)
    records = block_records(machine, Guids(new_guid), keys=keys, cargo=box)
    tracked = () if scenario is None else tracked_blocks(machine, scenario)
    references = {record.part: record.reference_key for record in records}
    references[records[0].part] = FIRST_BLOCK
    telling = None
    if scenario is not None:
        telling = Telling(
            prefix=marked(run_id),
            begin=begin_fields(machine, scenario, tracked, len(played)),
            last_update=round(scenario.duration_s * UPDATES_PER_S),
            blocks=_reported(machine, scenario, tracked, references),
            probes=tuple((probe.east, probe.north) for probe in level_probes(scenario)),
            ray_start=ray_start(scenario),
        )
    pilot = ""
    if scenario is not None and piloted:
        named = {part: reference_lua(reference) for part, reference in references.items()}
        pilot = pilot_lua(machine, scenario, records, named)
    script = script_text(
        header_lines(machine, records, presses, piloted=piloted),
        edges,
        pilot=pilot,
        cargo=None if scenario is None else scenario.cargo,
        cargo_reference=references.get(CARGO_ID, ""),
        telling=telling,
    )
    return PreparedMachine(
        pose=AS_BUILT if scenario is None else global_pose(machine, scenario),
        records=tuple(records),
        script=script,
        tracked=tracked,
        piloted=piloted,
    )


def marked(run_id: str) -> str:
    """Return the beginning of every line of a run's log: any id, escaped for a line of fields."""
    return f"ba,{quote(run_id, safe='', errors='replace')}"


def _reported(
    machine: Machine, scenario: Scenario, tracked: tuple[str, ...], references: Mapping[str, str]
) -> tuple[Reported, ...]:
    hot = set(cannons(machine))
    blocks = [
        Reported(reference=references[block_id], burns=block_id in hot) for block_id in tracked
    ]
    if scenario.cargo is not None:
        blocks.append(Reported(reference=references[CARGO_ID], cargo=True))
    return tuple(blocks)


def _require_playable(machine: Machine) -> None:
    if not machine.blocks:
        raise MachineNotPlayableError("The machine has no blocks.")
    if machine.part_count > MAX_PARTS:
        raise MachineNotPlayableError(
            f"The machine has {machine.part_count} parts; more than {MAX_PARTS} are not played."
        )


def _require_name(name: str) -> None:
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"{name!r} cannot be typed into the game's load box: use 1 to 100 lower case letters, "
            "digits, - and _"
        )


def _require_run_id(run_id: str) -> None:
    if not run_id or len(quote(run_id, safe="", errors="replace")) > _LONGEST_RUN_ID:
        raise ValueError(f"a run's id is a text of 1 to {_LONGEST_RUN_ID} characters")


def _require_sayable(machine: Machine, scenario: Scenario) -> None:
    """Refuse requirements that a machine file cannot express or a log cannot report.

    Raises:
        MachineNotPlayableError: The message names the requirement.
    """
    cargo, place = scenario.cargo, scenario.placement
    on_ground = place if isinstance(place, GroundPlacement) else GroundPlacement()
    usual = scenario.gravity == GRAVITY and scenario.drive_strength == 1
    asked: dict[str, object] = {
        "the game lets no machine go in the air": isinstance(place, ReleasedPlacement),
        "the game's cargo falls onto the machine": cargo is not None and cargo.at is not None,
        "the game's cargo is a box": cargo is not None and cargo.shape != "box",
        "the game's cargo is not turned": cargo is not None and cargo.heading_deg,
        "the game has no gusts": scenario.gusts,
        "the game pushes nothing": scenario.pushes,
        "the game's levels for trials are flat": scenario.planet is not None,
        "the game's fans and cannons burn no fuel": scenario.fuel_s is not None,
        "the game has no line on the ground": scenario.line,
        "the game's machines do not lean at the start": on_ground.tilt_deg,
        "the game's machines face north at the start": on_ground.heading_deg,
        "the game's levels have no turned boxes": any(box.heading_deg for box in scenario.terrain),
        "the game has one gravity and drives of one strength": not usual,
        # What is thrown over a line is judged by what it touches on its way.
        "the game's logs do not tell what a boulder touches": scenario.gates
        and any(block.module.is_loose for block in machine.blocks.values()),
    }
    for refusal, is_asked in asked.items():
        if is_asked:
            raise MachineNotPlayableError(f"{refusal}: use another engine")
