"""BuildArena's workflow of five roles, played by Inspect's models; needs the extra `roles`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import anyio
from inspect_ai.model import ChatMessageAssistant
from inspect_ai.solver import Generate, Solver, TaskState, solver

from buildarena_benchmark import failed_score
from buildarena_benchmark.environment import Trial
from buildarena_inspect.building import Building, building_of
from buildarena_inspect.errors import ChoiceError

if TYPE_CHECKING:
    from buildarena_backend.journal.transcript import ModelTurn

PACK = "default"
"""The service's default prompt pack."""
EXTRA = 'the solver `roles` needs the extra of this name: pip install "buildarena-inspect[roles]"'


@solver
def five_roles() -> Solver:
    """Run the benchmark's workflow: planner, drafter, reviewer, builder, guidance, controller.

    Inspect's `--model-role` sets the model of a role; the evaluated model plays all others.

    Raises:
        ChoiceError: The extra `roles` is not installed.
    """
    _require_extra()

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        del generate
        building = building_of(state)
        await anyio.to_thread.run_sync(_play, state, building, limiter=anyio.CapacityLimiter(1))
        return state

    return solve


def _require_extra() -> None:
    try:
        import buildarena_worker.workflow  # noqa: F401 - checked, used below
    except ImportError as error:
        raise ChoiceError(EXTRA) from error


def _play(state: TaskState, building: Building) -> None:
    """Run a complete session in the current thread."""
    from buildarena_backend.catalog.prompt_packs import PromptPacks
    from buildarena_inspect.role_host import RoleHost
    from buildarena_worker.session.results import Failed
    from buildarena_worker.session.session import Session
    from buildarena_worker.workflow.phases import FiveRole
    from buildarena_worker.workflow.rounds import run_session

    def on_turn(turn: ModelTurn, sequence: int) -> None:
        del sequence
        state.messages.append(_describe(turn))

    host = RoleHost(building)
    session = Session(
        task=building.environment.task,
        seed=building.conditions.seed or 0,
        model_config={"decoding": {}},
        pack=PromptPacks().load(PACK),
        host=host,
        on_turn=on_turn,
    )
    result = run_session(session, FiveRole(), rounds=building.conditions.rounds)
    if host.output is not None:
        state.output = host.output
    if isinstance(result, Failed):
        score = failed_score(session.task, session.machine)
        trial = Trial(score=score, reason=result.reason, detail=result.detail)
        building.adopt(session.machine, trial, submitted=False)


def _describe(turn: ModelTurn) -> ChatMessageAssistant:
    """Describe a turn for readers of the log; its event has the request."""
    lines = [turn.text] if turn.text else []
    lines += [f"{action.name}({action.arguments})\n→ {action.feedback}" for action in turn.actions]
    about = turn.stage if turn.sub_structure is None else f"{turn.stage}, {turn.sub_structure}"
    return ChatMessageAssistant(
        content=f"[{turn.role}, {about}]\n" + "\n".join(lines),
        metadata={"role": turn.role, "phase": turn.stage, "sub_structure": turn.sub_structure},
    )
