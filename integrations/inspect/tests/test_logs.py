"""Logs: opened by Inspect's viewer and its own readers, ranked, and refused in plain words."""

from __future__ import annotations

from pathlib import Path

import pytest
from inspect_ai import Task
from inspect_ai.dataset import Sample
from inspect_ai.log import read_eval_log
from inspect_ai.model import ModelOutput
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
