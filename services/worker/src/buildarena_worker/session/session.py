"""A session: one model, playing all roles, builds one machine for one task."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from buildarena_backend.catalog.prompt_packs import PromptPack
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.journal.transcript import ActionResult, ModelTurn, Transcript
from buildarena_benchmark import Task, broken_constraint
from buildarena_benchmark.environment.briefing import visible_catalogue
from buildarena_benchmark.environment.trials.trials import score_text
from buildarena_geometry import Catalogue, Machine
from buildarena_simulation import Trajectory
from buildarena_worker.session.host import SessionHost
from buildarena_worker.session.messages import Completion, Request
from buildarena_worker.session.results import ConstructionFailedError

OnTurn = Callable[[ModelTurn, int], None]
"""Receives a turn, and the index of its reply in the journal."""

MAX_CONVERSATION = 2_000_000
"""Characters of all messages together, some 500,000 tokens: with 40 sessions in a process, their
conversations fit into its memory."""


@dataclass(slots=True, kw_only=True, eq=False)
class Session:
    """The state that a workflow's steps share.

    Attributes:
        task: Task of the job.
        seed: The job's seed.
        model_config: The job's model configuration.
        pack: Prompt pack of the job.
        host: Source of replies and rollouts.
        on_turn: Receives every turn, those of stored replies included.
        data_sheets: Whether prompts include the parameters of modules and world.
        additions: Texts after the task's statement: varied worlds, an example, results of rounds.
        machine: Machine under construction.
        plan: The plan's text about the complete machine, "" without one.
        tested: Whether a trial of a task with test trials was requested.
        tests_used: Number of test trials used.
    """

    task: Task
    seed: int
    model_config: Mapping[str, Any]
    pack: PromptPack
    host: SessionHost
    on_turn: OnTurn | None = None
    data_sheets: bool = True
    additions: list[str] = field(default_factory=list)
    transcript: Transcript = field(default_factory=Transcript)
    machine: Machine | None = None
    plan: str = ""
    tested: bool = False
    tests_used: int = 0

    @property
    def statement(self) -> str:
        """The task's text for the model: statement, given machine and additions."""
        texts = [self.task.statement.strip()]
        if self.task.initial_machine is not None:
            summary = self.task.new_machine(self.catalogue).act("get_machine_summary", {}).text
            texts.append(f"## The machine as it is\n\n{summary}")
        return "\n\n".join([*texts, *self.additions])

    def say(self, message: str, **values: str) -> str:
        """Return one of the pack's messages about the task, with its placeholders filled."""
        return self.pack.say(message, task=self.task.name, **values)

    @property
    def catalogue(self) -> Catalogue:
        """The task's modules, with data sheets if prompts include them."""
        return visible_catalogue(self.task.constraints, data_sheets=self.data_sheets)

    def new_machine(self, available: Mapping[str, Machine] | None = None) -> Machine:
        """Return a machine of the task's modules, empty or given, and make it the session's.

        Args:
            available: Finished machines by name; with some, the new one is their assembly.
        """
        if available is None:
            self.machine = self.task.new_machine(self.catalogue)
        else:
            self.machine = Machine(catalogue=self.catalogue, available=available)
        return self.machine

    def ask(self, request: Request) -> Completion:
        """Return the model's reply to a conversation.

        Raises:
            ConstructionFailedError: The conversation exceeds the model's or the worker's limit.
        """
        detail = f"is longer than {MAX_CONVERSATION:,} characters"
        if sum(len(message.text) for message in request.messages) <= MAX_CONVERSATION:
            completion = self.host.ask(request)
            if completion.finish != "context_overflow":
                return completion
            detail = "outgrew the model's context"
        subject = f"the {request.role}'s conversation"
        raise ConstructionFailedError("context_overflow", f"{subject} {detail}")

    def describe_result(self, record: RolloutRecord, trajectory: Trajectory | None) -> str:
        """Describe a rollout's result, from its score and its trajectory, if it has one."""
        text = score_text(self.task, record.score, trajectory)
        refused = (record.versions or {}).get("refused")
        return text if refused is None else f"{text} It was not tried to the end: {refused}."

    def record(
        self,
        request: Request,
        completion: Completion,
        actions: Sequence[ActionResult],
        sub_structure: str | None,
    ) -> None:
        """Add a turn to the transcript."""
        turn = ModelTurn(
            index=len(self.transcript.turns),
            stage=request.phase,
            sub_structure=sub_structure,
            role=request.role,
            text=completion.text,
            actions=tuple(actions),
            finish=completion.finish,
            input_tokens=completion.usage.input_tokens,
            output_tokens=completion.usage.output_tokens,
            cost_usd=f"{completion.usage.cost_usd:.6f}",
            latency_s=completion.latency_s,
            tries=completion.attempts,
        )
        self.transcript.turns.append(turn)
        if self.on_turn is not None:
            self.on_turn(turn, completion.sequence)

    def check_machine(self, machine: Machine) -> None:
        """Check a finished machine against the task's constraints.

        Raises:
            ConstructionFailedError: The machine breaks a constraint.
        """
        self.machine = machine
        broken = broken_constraint(self.task, machine)
        if broken is not None:
            raise ConstructionFailedError(*broken)
