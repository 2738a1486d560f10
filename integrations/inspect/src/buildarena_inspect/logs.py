"""Reading of Inspect's logs, one sample at a time."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from inspect_ai.log import (
    EvalLog,
    EvalSample,
    EvalSampleSummary,
    read_eval_log,
    read_eval_log_sample,
    read_eval_log_sample_summaries,
)

from buildarena_inspect.building import CALLS, Conditions
from buildarena_inspect.errors import LogError
from buildarena_inspect.scorers import INDICATOR, SUCCESS
from buildarena_inspect.solvers import react_builder

MAX_LOG_BYTES: Final = 1 << 30
NOT_IN_NAMES: Final = re.compile(r"[^A-Za-z0-9_.-]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedSample:
    """A sample's content in its log, which the service does not trust.

    Attributes:
        uuid: Unique id of the sample, epoch and log.
        sample: Id in the data set.
        model: Name of the evaluated model.
        solver: Name of the solver.
        conditions: Settings of the sample.
        calls: The calls that reached its machines, in order.
        trials: Number of trials.
        success: Whether the sample met the task's criterion, by its log.
        indicator: Indicator, by its log.
        flags: Flags of the score, by its log.
        reason: Reason why it was not simulated; None if it was.
    """

    uuid: str
    sample: str
    epoch: int
    model: str
    solver: str
    conditions: Conditions
    task_version: str
    calls: Sequence[Mapping[str, Any]]
    trials: int
    success: bool
    indicator: float
    flags: tuple[str, ...]
    reason: str | None

    @property
    def agent(self) -> str:
        """Default name of the builder in imports: the model, and an unusual solver."""
        usual = react_builder.__name__
        solver = "" if self.solver in {"", usual} else f"-{self.solver}"
        return NOT_IN_NAMES.sub("-", f"{self.model}{solver}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Unusable:
    """A sample that can't be imported.

    Attributes:
        sample: Id in the data set.
        reason: Reason, as a sentence.
    """

    sample: str
    epoch: int
    reason: str


def state_of(path: Path) -> tuple[bool, str]:
    """Return whether a log has all planned samples, and a sentence about its progress.

    Raises:
        LogError: The file is not a log.
    """
    header, summaries = _opened(path)
    ids = header.eval.dataset.sample_ids
    planned = len(ids or ()) * (header.eval.config.epochs or 1)
    count = f"{path.name}: {len(summaries)}{f' of {planned}' if planned else ''} samples"
    if header.status != "success":
        return False, f"{count}: it is unfinished ({header.status})"
    if len(summaries) < planned:
        return False, f"{count}: it is partial"
    return True, count


def logged_samples(path: Path) -> Iterator[LoggedSample | Unusable]:
    """Yield the samples of a log.

    Raises:
        LogError: The file is not a log, or is one of other tasks.
    """
    header, summaries = _opened(path)
    for summary in summaries:
        try:
            sample = read_eval_log_sample(
                str(path), id=summary.id, epoch=summary.epoch, resolve_attachments=True
            )
            yield _parse(header, sample)
        except (IndexError, KeyError, TypeError, ValueError) as error:
            reason = str(error) if isinstance(error, LogError) else f"it can't be read: {error}"
            yield Unusable(sample=str(summary.id), epoch=summary.epoch, reason=reason)


def _opened(path: Path) -> tuple[EvalLog, list[EvalSampleSummary]]:
    try:
        size = path.stat().st_size
        header = read_eval_log(str(path), header_only=True) if size <= MAX_LOG_BYTES else None
        summaries = read_eval_log_sample_summaries(str(path)) if header is not None else []
    except OSError as error:
        raise LogError(f"{path}: {error.strerror or error}") from error
    except Exception as error:  # its readers pass on exceptions of their formats' libraries
        raise LogError(f"{path} is not a log of Inspect: {error}") from error
    if header is None:
        raise LogError(f"{path}: {size:,} bytes exceed the limit of {MAX_LOG_BYTES:,}")
    return header, summaries


def _parse(header: EvalLog, sample: EvalSample) -> LoggedSample:
    conditions = Conditions.from_metadata(sample.metadata)
    if sample.error is not None:
        first = sample.error.message.strip().partition("\\n")[0]
        raise LogError(f"it ended in an error: {first}")
    scores = sample.scores or {}
    if SUCCESS not in scores or INDICATOR not in scores or CALLS not in sample.store:
        raise LogError("it was not scored by BuildArena's scorers")
    if sample.invalidation is not None:
        raise LogError(f"it was invalidated: {sample.invalidation.reason or 'no reason is given'}")
    for name in (SUCCESS, INDICATOR):
        # A session's score can't be set by hand, so what was is not imported as if it were earned.
        if scores[name].history:
            raise LogError(f"its score {name!r} was edited to {scores[name].value!r}")
        if scores[name].value != scores[name].value:  # NaN marks a score that metrics skip
            raise LogError(f"its score {name!r} was excluded from the metrics")
    if sample.uuid is None:
        raise LogError("it has no unique id: its log was written by an older Inspect")
    figures = scores[SUCCESS].metadata or {}
    return LoggedSample(
        uuid=sample.uuid,
        sample=str(sample.id),
        epoch=sample.epoch,
        model=header.eval.model,
        solver=header.plan.steps[-1].solver.rpartition("/")[2] if header.plan.steps else "",
        conditions=conditions,
        task_version=str(sample.metadata["task_version"]),
        calls=[
            {"machine": str(c["machine"]), "tool": str(c["tool"]), "arguments": c["arguments"]}
            for c in sample.store[CALLS]
        ],
        trials=int(figures["trials"]),
        success=bool(figures["success"]),
        indicator=float(figures["indicator"]),
        flags=tuple(str(flag) for flag in figures["flags"]),
        reason=None if figures["reason"] is None else str(figures["reason"]),
    )
