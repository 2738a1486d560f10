"""A session's rounds from task to score: one, or several in a closed loop.

In a closed loop a failed round is followed by another, which reads the simulator's measurements
and, if configured, an analyst's advice.
"""

from buildarena_backend.catalog.prompt_packs import PromptPack
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.trials.scoring import best_rollout
from buildarena_benchmark import Task, builtin_tasks
from buildarena_benchmark.experts import expert_designs
from buildarena_geometry import Machine
from buildarena_worker.session import results
from buildarena_worker.session.session import Session
from buildarena_worker.workflow import Workflow
from buildarena_worker.workflow.analyst import analyse
from buildarena_worker.workflow.control import drive

EXAMPLE_SEED = 0


def run_session(
    session: Session,
    workflow: Workflow,
    *,
    rounds: int = 1,
    analyst: bool = False,
    one_shot: bool = False,
) -> results.SessionResult:
    """Build, check and simulate until a round succeeds or all are used up.

    Args:
        rounds: Maximum number of rounds.
        analyst: Whether an analyst advises between rounds.
        one_shot: Whether prompts include an example construction.

    Returns:
        The session's result; its transcript and machine remain as they were at the end.
    """
    if one_shot:
        session.additions.append(example_for(session.task, session.pack))
    records: list[RolloutRecord] = []
    failure: results.Failed | None = None
    try:
        for number in range(1, rounds + 1):
            final = number == rounds
            try:
                machine, record = _play_round(session, workflow, final=final)
            except results.ConstructionFailedError as failed:
                failure = failed.result
                if session.tested:
                    return failure  # another round would get new test trials
                session.additions.append(
                    session.say("round_failed", round=str(number), reason=failure.detail)
                )
                continue
            records.append(record)
            # With test trials, the trial that counts is the last one.
            if record.success or final or session.task.test_trials:
                break
            _report(session, machine, record, number, analyst=analyst)
    except results.SessionEnded as ended:
        return ended.result
    if records:
        return results.Finished(best=best_rollout(records, session.task))
    assert failure is not None, "a loop has at least one round"  # noqa: S101 - ours
    return failure


def _play_round(
    session: Session, workflow: Workflow, *, final: bool
) -> tuple[Machine, RolloutRecord]:
    """Return a round's machine and its best rollout."""
    machine = workflow.build(session)
    session.check_machine(machine)
    if session.task.control == "agent" and session.task.initial_machine is None:
        return machine, drive(session, machine, final=final)
    return machine, session.host.simulate(machine, None, final=final)


def _report(
    session: Session, machine: Machine, record: RolloutRecord, number: int, *, analyst: bool
) -> None:
    """Add a failed round's result and the analyst's advice to the next round's prompt."""
    result = session.describe_result(record, session.host.trajectory(record))
    session.additions.append(session.say("round_result", round=str(number), result=result))
    if analyst:
        advice = analyse(session, machine, record, number=number, result=result)
        session.additions.append(session.say("advice", round=str(number), advice=advice))


def example_for(task: Task, pack: PromptPack) -> str:
    """Return the expert's design for the first level of the task's category as an example.

    A category without one gets the example of the first other task with the same scorer, or else
    the first of all examples.
    """
    designs, name = expert_designs(), f"{task.category}-1"
    if name not in designs:
        alike = [n for n in designs if n != task.name and builtin_tasks()[n].scorer == task.scorer]
        name = next(iter(alike or designs))
    part = next(iter(designs[name](EXAMPLE_SEED).parts.values()))
    actions = "\n".join(
        f"{number}. {action}({', '.join(f'{key}={value!r}' for key, value in arguments.items())})"
        for number, (action, arguments) in enumerate(part.actions, start=1)
    )
    return pack.say("example", example_task=name, actions=actions)
