"""The control phase: the controller programs the keys, reads the result, and revises."""

import math
import re
from collections.abc import Sequence
from itertools import takewhile
from typing import Any, Final

from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.trials.scoring import best_rollout
from buildarena_benchmark.environment.briefing import describe_programs, describe_tests
from buildarena_benchmark.environment.trials.world import units_text
from buildarena_geometry import Machine
from buildarena_geometry.feedback.modules import module_text
from buildarena_geometry.feedback.words import point
from buildarena_geometry.json_texts import read_json
from buildarena_simulation import Piloting
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.controllers.pilot import find_names
from buildarena_simulation.controllers.program import Program
from buildarena_simulation.errors import ControllerFailed
from buildarena_worker.session.dialogue import Dialogue, Role
from buildarena_worker.session.host import Setup
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session

ATTEMPTS = 3
"""Attempts of a transport session; the best counts. Source: the paper's task details."""
PROGRAM_TURNS = 5
"""Answers allowed for one attempt; an unreadable one costs a turn, not a trial."""
STILL: Final = 0.02
"""Distance from its final position below which a machine has stopped, units."""
ROWS_PER_S: Final = 2
MAX_SENSES: Final = 24
MAX_ANSWERS: Final = 12
_KEEP = re.compile(r"\A[\s*_`'\"]*KEEP[\s*_`'\".!]*\Z")
"""An answer that keeps the best trial, or the last test, instead of trying again."""
_PROGRAM_HINT = "a program stands between a line of ```lua and one of ```"


class _ProgramError(ValueError):
    """An unusable answer of the controller; the message contains the reason."""


def drive(session: Session, machine: Machine, *, final: bool) -> RolloutRecord:
    """Let the controller drive the machine in up to three attempts.

    If the task has test trials, there are as many attempts, and another that ends the job; it is
    the next one if the controller keeps what it has tested.

    Args:
        final: Whether the job ends with the last attempt.

    Returns:
        The best rollout.

    Raises:
        ConstructionFailedError: No attempt had a usable program.
        SessionEnded: A simulation is required first.
    """
    task = session.task
    dialogue, controller = _dialogue(session, machine)
    records: list[RolloutRecord] = []
    control: Setup = (machine, None)
    attempts = task.test_trials + 1 if task.test_trials else ATTEMPTS
    final = final or task.test_trials > 0
    for attempt in range(session.tests_used + 1, attempts + 1):
        try:
            keeps = bool(records) if task.test_trials else any(record.counts for record in records)
            program = _program(dialogue, controller, machine, session, keeps=keeps)
        except _ProgramError as error:
            if not records or task.test_trials:
                raise ConstructionFailedError("control_invalid", str(error)) from error
            break
        if program is None and not task.test_trials:
            break
        last = program is None or attempt == attempts
        control = program or control
        session.machine = control[0]
        session.tested = task.test_trials > 0
        if task.test_trials and not last:
            session.tests_used += 1
        record = session.host.simulate(*control, final=final and last)
        records.append(record)
        if last:
            break
        dialogue.remark(controller, _outcome(session, record, attempt))
    return best_rollout(records, task)


def _dialogue(session: Session, machine: Machine) -> tuple[Dialogue, Role]:
    """Create the dialogue about a machine, and the controller."""
    task = session.task
    opening = session.say(
        "control",
        statement=session.statement,
        plan=session.plan or session.say("no_plan"),
        machine=_unpowered(machine),
        powered=_powered(machine),
        modules=driven_modules(session, machine),
    )
    if task.takes_programs:
        opening += "\n\n" + session.say(
            "control_programs",
            contract=describe_programs(task),
            mass=f"{float(machine.mass):g}",
            center=point(tuple(machine.center_of_mass.tolist())),
        )
    if task.test_trials:
        opening += "\n\n" + session.say("control_tests", tests=describe_tests(task))
    dialogue = Dialogue(session, phase="control", opening=opening)
    return dialogue, Role(name="controller", system=session.pack.roles["controller"])


def _outcome(session: Session, record: RolloutRecord, attempt: int) -> str:
    """Return the message to the controller after a trial: the result and the next step."""
    frame = "control_success" if record.counts else "control_again"
    tests = session.task.test_trials
    trajectory = session.host.trajectory(record)
    message = session.say(
        "control_tested" if tests else frame,
        trial=str(attempt),
        trials=str(tests or ATTEMPTS),
        left=str(tests - attempt),
        trajectory=format_trace(record.trace or ()),
        result=session.describe_result(record, trajectory),
    )
    if trajectory is None or trajectory.piloting is None or session.machine is None:
        return message
    table = format_piloting(trajectory.piloting, session.machine.controller)
    return f"{message}\n\n{session.say('program_trace', trace=table)}"


def driven_modules(session: Session, machine: Machine) -> str:
    """Describe the modules of a machine that move by keys or by themselves."""
    used = {part.module.name: part.module for part in machine.state.parts}
    driven = [
        module
        for module in used.values()
        if module.actions or (module.joint is not None and module.joint.drive)
    ]
    lines = [f"- {module_text(module, session.catalogue)}" for module in driven]
    if session.data_sheets and lines:
        lines.append(f"\n{units_text(session.catalogue, session.task)}")
    return "\n".join(lines) or "(none)"


def _program(
    dialogue: Dialogue, controller: Role, machine: Machine, session: Session, *, keeps: bool
) -> Setup | None:
    """Return the controller's next usable answer; None if it keeps the one before.

    Raises:
        _ProgramError: None within the turns; the message is the last one's.
    """
    error = _ProgramError("nothing was said")
    for _ in range(PROGRAM_TURNS):
        text = dialogue.turn(controller).text
        if keeps and _KEEP.search(text) is not None:
            return None
        try:
            return _parse_answer(machine, text, programs=session.task.takes_programs)
        except _ProgramError as unusable:
            error = unusable
            dialogue.remark(controller, session.say("program_again", error=str(error)))
    raise error


def _unpowered(machine: Machine) -> str:
    """Return the machine's summary without the blocks that keys move."""
    text = machine.act("get_machine_summary", {}).text
    powered = {f"{block.id} " for block in machine.blocks.values() if block.module.actions}
    return "\n".join(line for line in text.splitlines() if not line.startswith(tuple(powered)))


def _powered(machine: Machine) -> str:
    """Return each block that keys can move, with its actions and their keys."""
    lines = machine.act("review_powered_blocks", {}).text.splitlines()
    blocks = {block.id: block for block in machine.blocks.values() if block.module.actions}
    rows = []
    for line in lines:
        block = blocks.get(line.split(" ", 1)[0])
        if block is None:
            rows.append(line)
            continue
        actions = (
            f"{action} ({', '.join(block.bindings.get(action, ())) or 'no key'})"
            for action in block.module.actions
        )
        rows.append(f"{line}; actions: {', '.join(actions)}")
    return "\n".join(rows)


def _parse_answer(machine: Machine, text: str, *, programs: bool) -> Setup:
    """Return the control in an answer: its last program, or its key presses."""
    driven = Machine.from_document(machine.to_document())
    written = _last_program(text) if programs else None
    if written is not None:
        try:
            Program(written)
        except ControllerFailed as failure:
            raise _ProgramError(failure.reason) from failure
        outcome = driven.act("set_controller", {"program": written})
        if not outcome.ok:
            raise _ProgramError(outcome.text)
        return driven, None
    try:
        return _parse_keys(driven, text)
    except _ProgramError as error:
        if programs:
            raise _ProgramError(f"{error}; {_PROGRAM_HINT}") from error
        raise


def _last_program(text: str) -> str | None:
    """Return the last complete block of Lua in a text, if any."""
    program: str | None = None
    inside: list[str] | None = None
    for line in text.splitlines(keepends=True):
        mark = "".join(line.split()).lower()
        if inside is None:
            inside = [] if mark == "```lua" else None
        elif mark == "```":
            program, inside = "".join(inside), None
        else:
            inside.append(line)
    return program


def _parse_keys(driven: Machine, text: str) -> Setup:
    data = _json_object(text)
    bindings = data.get("control_config")
    if not isinstance(bindings, list) or not bindings:
        raise _ProgramError("control_config must be a list with at least one entry")
    for index, entry in enumerate(bindings):
        block, action, keys = _binding(entry)
        if not keys:
            raise _ProgramError(f"control_config[{index}] needs block, action and keys")
        for key in keys:
            arguments = {"block_id": block, "action": action, "new_key": key}
            outcome = driven.act("add_control_key", arguments)
            if not outcome.ok:
                raise _ProgramError(f"control_config[{index}]: {outcome.text}")
    presses = data.get("control_sequence")
    if not isinstance(presses, list) or not presses:
        raise _ProgramError("control_sequence must be a list with at least one entry")
    for index, press in enumerate(presses):
        # The published form has an additional text.
        known = press
        if isinstance(press, dict):
            known = {name: value for name, value in press.items() if name != "motion_action"}
        outcome = driven.act("add_control_sequence", known)
        if not outcome.ok:
            raise _ProgramError(f"control_sequence[{index}]: {outcome.text}")
    return driven, driven.control_sequence


def _binding(entry: object) -> tuple[object, object, list[object]]:
    """Return block, action and keys of an entry; the published form has block_id and one key."""
    if not isinstance(entry, dict):
        return None, None, []
    block = entry.get("block", entry.get("block_id"))
    keys = entry.get("keys", entry.get("key"))
    keys = keys if isinstance(keys, list) else [] if keys is None else [keys]
    return block if block is None else str(block), entry.get("action"), keys


def _json_object(text: str) -> dict[str, Any]:
    start, end = text.find("{"), text.rfind("}")
    if start < 0 or end < start:
        raise _ProgramError("the answer holds no JSON object")
    try:
        data = read_json(text[start : end + 1])
    except ValueError as error:
        raise _ProgramError(f"the answer's JSON can't be read: {error}") from error
    if not isinstance(data, dict):
        raise _ProgramError("the answer must be one JSON object")
    return data


def format_trace(trace: Sequence[Sequence[float]]) -> str:
    """Format rows of time and position; a last line replaces the rows without movement.

    Args:
        trace: Rows of time, seconds, and x, y, z, units.
    """
    moving = len(trace)
    while moving > 1 and math.dist(trace[moving - 2][1:], trace[-1][1:]) < STILL:
        moving -= 1
    rows = [", ".join(f"{value:.2f}" for value in row) for row in trace[:moving]]
    if moving < len(trace):
        rows.append(f"It stays there until {trace[-1][0]:g} s.")
    return "\n".join(rows) or "(none)"


def format_piloting(piloting: Piloting, program: str) -> str:
    """Format a table of a program's inputs and outputs, twice a second.

    The inputs are the first ones whose names the program's text contains.

    Args:
        piloting: Inputs and outputs of the program.
        program: Text of the program.
    """
    named = find_names(program, piloting.sense_names)[:MAX_SENSES]
    senses = [piloting.sense_names.index(name) for name in named]
    heads = ["t", *named, *piloting.action_names[:MAX_ANSWERS]]
    rows = []
    ticks = len(piloting.answers) - 1
    marks = (round(k * SAMPLE_RATE_HZ / ROWS_PER_S) for k in range(ticks))
    for tick in takewhile(lambda mark: mark < ticks, marks):
        figures = [*piloting.senses[tick, senses], *piloting.answers[tick, :MAX_ANSWERS]]
        values = ", ".join(f"{value:.2f}" for value in figures)
        rows.append(f"{tick / SAMPLE_RATE_HZ:g}, {values}")
    return "\n".join([", ".join(heads), *rows])
