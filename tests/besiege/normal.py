"""A machine's export in a normalised form, as JSON values: what its file holds, without layout.

The form is that of the golden files: guids are left out, reference keys hold "<guid8>" in their
place, and the script's text is left out.
"""

from collections.abc import Iterable
from typing import Any

from buildarena_besiege.errors import MachineNotPlayableError
from buildarena_besiege.exporting.entries import Entry, Value
from buildarena_besiege.exporting.machine_file import BSG_VERSION, BlockRecord, global_entries
from buildarena_besiege.keys import bound_presses
from buildarena_besiege.names import CARGO_ID
from buildarena_besiege.run import prepared_machine
from buildarena_geometry import Machine
from buildarena_geometry.rotations import Quaternion
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import SpanPlacement


def normal_form(machine: Machine, scenario: Scenario | None = None) -> dict[str, Any]:
    """The normalised export of a machine.

    Args:
        machine: The machine.
        scenario: A task's; None for the machine as it was built.

    Returns:
        A field refused; where it is not refused, also run, tracked, machine, global, data and
        blocks.
    """
    refused = None if scenario is None else refusal_of(machine, scenario)
    if refused is not None:
        return {"refused": refused}
    try:
        prepared = prepared_machine(machine, scenario, run_id="normal-form")
    except MachineNotPlayableError as error:
        return {"refused": str(error)}
    driven = scenario is not None and scenario.control.mode == "agent"
    suffix = "_sim_1" if driven else "_sim"
    cargo = [CARGO_ID] if scenario is not None and scenario.cargo is not None else []
    return {
        "refused": None,
        "run": None
        if scenario is None
        else {
            "machine_name_suffix": suffix,
            "duration_s": scenario.duration_s,
            "set_ground": not isinstance(scenario.placement, SpanPlacement),
        },
        "tracked": [*prepared.tracked, *cargo],
        "machine": {
            "version": "1",
            "bsgVersion": BSG_VERSION,
            "name": "plain" if scenario is None else f"m{suffix}",
        },
        "global": {
            "position": list(prepared.pose.position),
            "rotation_xyzw": _xyzw(prepared.pose.rotation),
        },
        "data": [
            [kind, key, None if key == "lua_data" else _value(value)]
            for kind, key, value in global_entries("")
        ],
        "blocks": [_block(record) for record in prepared.records],
    }


def _block(record: BlockRecord) -> dict[str, Any]:
    kind = {"local_id": record.part, "name": record.module.name, "id": record.module.besiege.id}
    data, turned = list(_data(record.all_entries, record.guid[:8])), _xyzw(record.rotation)
    place = {"position": list(record.position), "scale": list(record.scale)}
    return {**kind, **place, "rotation_xyzw": turned, "data": data}


def _data(entries: Iterable[Entry], guid8: str) -> Iterable[list[Any]]:
    for kind, key, value in entries:
        shown = _value(value)
        if key == "bmt-lua_ref_key":
            shown = str(value).replace(guid8, "<guid8>")
        yield [kind, key, sorted(shown) if kind == "StringArray" and value != shown else shown]


def _value(value: Value) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _xyzw(rotation: Quaternion) -> list[float]:
    w, x, y, z = rotation
    return [x, y, z, w]


def refusal_of(machine: Machine, scenario: Scenario) -> str | None:
    """Why the published runner would not play a machine in a scenario; None if it would.

    The game takes such machines; there is nothing to see.
    """
    if scenario.control.mode == "agent":
        if not any(block.module.actions for block in machine.blocks.values()):
            return "no control file"
        if not machine.state.keys_in_use():
            return "no key bound"
        if not bound_presses(machine.control_sequence, machine):
            return "no control sequence"
    return "only a starting block" if machine.part_count == 1 else None
