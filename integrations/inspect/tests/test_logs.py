"""Logs: opened by Inspect's viewer and its own readers, ranked, and refused in plain words."""

from pathlib import Path

import pytest
from inspect_ai import Task
from inspect_ai.dataset import Sample
from inspect_ai.log import (
    ProvenanceData,
    edit_score,
    invalidate_samples,
    read_eval_log,
    write_eval_log,
)
from inspect_ai.model import ModelOutput
from inspect_ai.scorer import ScoreEdit
from scripted_models import EXPERTS, listed, only

from buildarena_inspect.__main__ import main
from buildarena_inspect.logs import LoggedSample, logged_samples

pytestmark = pytest.mark.nightly


def test_what_is_no_log_of_ours_is_refused_in_plain_words(run, tmp_path, capsys) -> None:
    nothing, garbage = tmp_path / "nothing.eval", tmp_path / "garbage.eval"
    garbage.write_bytes(b"PK no")
    for path, message in ((nothing, "No such file"), (garbage, "is not a log of Inspect")):
        assert main(["import", str(path)]) == 2
        assert message in capsys.readouterr().err
    talking = listed(ModelOutput.from_content("mockllm", "Hello"))
    strange = run(Task([Sample(input="Say hello.")]), talking)
    (found,) = logged_samples(Path(strange.location))
    assert "not a sample of BuildArena" in found.reason


def test_the_calls_that_a_log_keeps_are_those_that_were_made(run) -> None:
    log = run("buildarena/support_1")
    (found,) = logged_samples(Path(log.location))
    assert isinstance(found, LoggedSample)
    assert list(found.calls) == EXPERTS["support-1"]["calls"]
    assert (found.agent, found.success) == ("mockllm-model", True)
    assert read_eval_log(log.location).status == "success"
    assert only(log).uuid == found.uuid


def test_samples_that_their_log_takes_back_are_left_out(run, tmp_path) -> None:
    log = run("buildarena/support_1")
    sample = only(log)
    by = ProvenanceData(author="lab", reason="the model read the answer")

    def edited(log):
        edit_score(log, sample.id, "indicator", ScoreEdit(value=0.0, provenance=by))
        return log

    def unscored(log):
        log.samples[0].scores["indicator"].value = float("nan")
        return log

    changes = {
        "invalidated: the model read the answer": lambda log: invalidate_samples(log, "all", by),
        "'indicator' was edited to 0": edited,
        "'indicator' was excluded": unscored,
    }
    for number, (reason, change) in enumerate(changes.items()):
        file = tmp_path / f"{number}.eval"
        changed = change(read_eval_log(log.location, resolve_attachments="full"))
        write_eval_log(changed, str(file))
        (found,) = logged_samples(file)
        assert reason in getattr(found, "reason", ""), reason
