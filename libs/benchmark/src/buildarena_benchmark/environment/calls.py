"""An episode played by tool calls, as models make them: `submit` is one of the tools."""

from dataclasses import dataclass, replace
from typing import Any, Final

from buildarena_benchmark.environment.environment import Environment
from buildarena_benchmark.environment.episodes import Submission
from buildarena_benchmark.environment.errors import CallError, NothingToSubmitError
from buildarena_benchmark.environment.tools import MAIN, SUBMIT, refuse_malformed
from buildarena_benchmark.environment.trials.trials import Trial
from buildarena_geometry.json_texts import read_json

EXAMPLE: Final = '{"tool": "start", "arguments": {}}'
"""A call as text."""
LONGEST_CALL: Final = 80_000
"""Characters that an adapter reads of a call: JSON that quotes the longest program has room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Result of a tool call.

    Attributes:
        gained: Change of the reward by this call.
        terminated: Whether a submission ended the episode.
        truncated: Whether the episode ended because its calls are used up; the machine was
            submitted then.
        trial: The trial, if the call led to one.
    """

    text: str
    accepted: bool
    reward: float
    gained: float
    terminated: bool = False
    truncated: bool = False
    trial: Trial | None = None


def call(environment: Environment, tool: object, arguments: object = None) -> Answer:
    """Carry out a call of one of the tools that `Environment.observation` lists.

    Whatever a model gives is answered: a refused call counts as a step, also a submission of
    nothing. After the last step there is a submission of what there is.

    Args:
        arguments: Its arguments with `machine` among them, or None for none.

    Raises:
        EpisodeOverError: The episode has ended.
        SimulationError: The simulator failed. The episode is unchanged except for a last
            step, after which any call submits.
    """
    return _play(environment, tool, arguments)


def call_text(environment: Environment, text: str, *, longest: int | None = None) -> Answer:
    """Carry out a call that is written as JSON, such as `EXAMPLE`.

    Text that is not a call counts as a refused step.

    Args:
        longest: Most characters; None for any number.

    Raises:
        EpisodeOverError: The episode has ended.
        SimulationError: As for `call`.
    """
    try:
        return _play(environment, *parse_call(text, longest=longest))
    except CallError as error:
        return _play(environment, None, None, refusal=str(error))


def parse_call(text: str, *, longest: int | None = None) -> tuple[str, dict[str, Any]]:
    """Return tool and arguments of a call that is written as JSON.

    Args:
        longest: Most characters; None for any number.

    Raises:
        CallError: It is not a call; the message says what is wrong.
    """
    if longest is not None and len(text) > longest:
        raise CallError(f"the call has {len(text):,} characters: at most {longest:,} are read")
    try:
        value = read_json(text)
    except ValueError as error:
        raise CallError(f"this is not valid JSON ({error}): write {EXAMPLE}") from None
    if not isinstance(value, dict):
        raise CallError(f"a call is an object: write {EXAMPLE}")
    for name in value:
        if name not in ("tool", "arguments"):
            raise CallError(f"a call has no {name[:40]!r}: choose from tool, arguments")
    tool, arguments = value.get("tool"), value.get("arguments", {})
    if not isinstance(tool, str):
        raise CallError(f"'tool' is a tool's name: write {EXAMPLE}")
    if not isinstance(arguments, dict):
        raise CallError(f"'arguments' are an object: write {EXAMPLE}")
    return tool, arguments


def _play(
    environment: Environment, tool: object, arguments: object, *, refusal: str | None = None
) -> Answer:
    """Carry out a call, or count it as refused for a given reason."""
    before = environment.reward
    if not environment.done and environment.remaining_steps == 0:
        return _answer_submission(environment.finish(), before, truncated=True)
    machine: object = MAIN
    if refusal is None and tool == SUBMIT.name:
        if malformed := refuse_malformed(SUBMIT, arguments):
            refusal = malformed.text
        else:
            try:
                return _answer_submission(environment.submit(), before)
            except NothingToSubmitError as nothing:
                refusal = str(nothing)
    elif isinstance(arguments, dict) and "machine" in arguments:
        arguments = dict(arguments)
        machine = arguments.pop("machine")
        if not isinstance(machine, str):
            refusal = f"'machine' is a name, not {type(machine).__name__}"
    if refusal is not None:
        step = environment.refuse(refusal)
    else:
        step = environment.step(tool, arguments, machine=str(machine))
    if not step.truncated:
        return Answer(
            text=step.feedback, accepted=step.ok, reward=step.reward, gained=step.reward - before
        )
    ended = _answer_submission(environment.finish(), before, truncated=True)
    text = f"{step.feedback}\nThat was the last call: what there is was submitted. {ended.text}"
    return replace(ended, text=text, accepted=step.ok)


def _answer_submission(submission: Submission, before: float, *, truncated: bool = False) -> Answer:
    return Answer(
        text=submission.report,
        accepted=True,
        reward=submission.reward,
        gained=submission.reward - before,
        terminated=submission.done and not truncated,
        truncated=truncated,
        trial=submission.trial,
    )
