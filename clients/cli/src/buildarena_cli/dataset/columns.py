"""The table of a dataset: each column with its type and its meaning, which the card repeats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import pyarrow as pa


@dataclass(frozen=True, slots=True)
class Column:
    """A column.

    Attributes:
        type: Arrow's type; all columns except those of ids are nullable.
        meaning: Description for the card.
    """

    name: str
    type: Any
    meaning: str


FUNCTION: Final = pa.struct([("name", pa.string()), ("arguments", pa.string())])
CALL: Final = pa.struct([("id", pa.string()), ("type", pa.string()), ("function", FUNCTION)])
MESSAGE: Final = pa.struct(
    [
        ("role", pa.string()),
        ("content", pa.string()),
        ("name", pa.string()),
        ("tool_calls", pa.list_(CALL)),
        ("tool_call_id", pa.string()),
        ("machine", pa.string()),
    ]
)
_TEXT, _WHOLE, _REAL, _YES = pa.string(), pa.int64(), pa.float64(), pa.bool_()

JOBS: Final[Sequence[Column]] = (
    Column("job_id", _TEXT, "The job. The same task, model, settings and seed have the same id."),
    Column("task", _TEXT, "Name of the task."),
    Column("model", _TEXT, "What built: a model, a baseline, `agent/NAME` or `human/NAME`."),
    Column("seed", _WHOLE, "Seed of the session; trials of one machine are alike."),
    Column("outcome", _TEXT, "How the job ended; `errored` and `cancelled` ones have no score."),
    Column("success", _REAL, "Share of its worlds that the machine passed, 0 to 1."),
    Column("indicator", _REAL, "The task's figure: load, distance, height or thrust to weight."),
    Column("task_version", _TEXT, "Hash of everything in the task that can change a score."),
    Column("task_title", _TEXT, "The task's title."),
    Column("category", _TEXT, "Kind of machine that the task asks for."),
    Column("level", _WHOLE, "Difficulty, 1 to 3."),
    Column("custom_task", _YES, "Whether a user uploaded the task; others come with BuildArena."),
    Column("configuration", _TEXT, "Hash of the model, its decoding and its limits."),
    Column("decoding", _TEXT, "JSON: how the model was asked, such as its temperature."),
    Column("track", _TEXT, "Workflow, simulator and prompts; scores of one track compare."),
    Column("workflow", _TEXT, "How the session went about building."),
    Column("simulator", _TEXT, "What tried the machine."),
    Column("reason", _TEXT, "Class of the failure, if there was one."),
    Column("disqualified", _YES, "Whether a flag makes it a failure in our rankings."),
    Column("flags", pa.list_(_TEXT), "Remarks on the score."),
    Column("indicator_name", _TEXT, "What the figure is."),
    Column("indicator_unit", _TEXT, "Its unit; `1` for a ratio."),
    Column("censored", _YES, "Whether the figure is only known to be at least as great."),
    Column("metrics", _TEXT, "JSON: further figures of the trial."),
    Column(
        "messages",
        pa.list_(MESSAGE),
        "The session as a chat in chronological order: messages to roles, each reply with its tool "
        "calls, and their results. `name` is the role that speaks or is addressed; `machine` the "
        "sub-structure that a reply's calls are for; `arguments` JSON.",
    ),
    Column("tools", _TEXT, "JSON: the tools as definitions of functions, as `tools=` takes them."),
    Column("machine", _TEXT, "JSON: the machine document, byte for byte as it is kept."),
    Column("machine_sha256", _TEXT, "SHA-256 of `machine` as UTF-8."),
    Column("transcript_sha256", _TEXT, "SHA-256 of the transcript as the service keeps it."),
    Column("trajectory_sha256", pa.list_(_TEXT), "SHA-256 of each trial's trajectory, in order."),
    Column("versions", _TEXT, "JSON: versions of everything that can change the result."),
    Column("actions", _WHOLE, "Actions tried."),
    Column("refused_actions", _WHOLE, "Those of them that were refused."),
    Column("refusals", _TEXT, "JSON: refused actions by class."),
    Column("requests", _WHOLE, "Model requests; null where an agent reports nothing, as below."),
    Column("input_tokens", _WHOLE, "Tokens sent."),
    Column("output_tokens", _WHOLE, "Tokens received, hidden reasoning included."),
    Column("cached_tokens", _WHOLE, "Part of the input that the provider had in its cache."),
    Column("reasoning_tokens", _WHOLE, "Part of the output that was hidden reasoning."),
    Column("cost_usd", _REAL, "Price of the requests, US dollars."),
    Column("ran_on_runner", _YES, "Whether a runner ran one of its trials."),
    Column("audit", _TEXT, "required, verified or refuted: only null and verified ones count."),
    Column("verified", _YES, "Of jobs by runners: whether they were verified."),
    Column("finished_at", pa.timestamp("us", tz="UTC"), "When it ended."),
    Column("license", _TEXT, "Licence of the row."),
    Column("canary", _TEXT, "The same in every row: a corpus that has it holds benchmark data."),
)


def schema() -> Any:
    """Return the Arrow schema of the table."""
    return pa.schema([pa.field(column.name, column.type) for column in JOBS])
