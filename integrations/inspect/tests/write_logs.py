"""Writes logs for the test of imports, in the folder that the command line names.

`python write_logs.py FOLDER`: a log in which the expert builds, one sample builds nothing, and one
a stub; and the same log with another score.
"""

import sys
from pathlib import Path

from inspect_ai import eval as evaluate
from inspect_ai.log import read_eval_log, write_eval_log
from inspect_ai.model import ChatMessage, ModelOutput
from scripted_models import call, calls_in, expert, scripted, task_in

LIFTED = 999.0


def mixed(messages: list[ChatMessage]) -> ModelOutput:
    """The expert on most tasks; nothing at all on lift-2, two sub-structures on support-2."""
    task = task_in(messages)
    if task == "lift-2":
        return ModelOutput.from_content("mockllm", "I would rather not.")
    if task == "support-2":
        parts = ("left", "right")
        done = calls_in(messages)
        return call("start", {"machine": parts[done]}) if done < 2 else call("submit", {})
    if task == "support-1" and not calls_in(messages):
        return call("start", {"machine": "a name with blanks"})
    return expert(messages, late=int(task == "support-1"))


def main(folder: Path) -> None:
    tasks = ["support-1", "support-2", "support-3", "lift-2"]
    where = {"log_dir": str(folder / "made"), "display": "none"}
    (log,) = evaluate("buildarena/all", model=scripted(mixed), sample_id=tasks, **where)
    Path(log.location).rename(folder / "honest.eval")
    lying = read_eval_log(str(folder / "honest.eval"), resolve_attachments="full")
    for sample in lying.samples or ():
        assert sample.scores is not None
        score = sample.scores["success"]
        score.metadata = {**(score.metadata or {}), "indicator": LIFTED, "success": True}
        score.value = "C"
    write_eval_log(lying, str(folder / "lying.eval"))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
