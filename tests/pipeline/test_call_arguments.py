"""What the arguments of an external agent's call may be."""

from __future__ import annotations

from typing import Any

import pytest

from buildarena_pipeline.agents.workbench import MAX_BYTES, MAX_DEPTH, check_arguments
from buildarena_pipeline.errors import SubmissionError


def lists(levels: int, inner: Any) -> Any:
    for _ in range(levels):
        inner = [inner]
    return inner


def objects(levels: int, inner: Any) -> Any:
    for _ in range(levels):
        inner = {"k": inner}
    return inner


def test_bounded_arguments_pass(subtests) -> None:
    for arguments in [
        lists(MAX_DEPTH, 1),
        objects(MAX_DEPTH, "x"),
        lists(MAX_DEPTH - 1, {}),
        [1, "x", objects(MAX_DEPTH - 1, None)],
        None,
        "x" * (MAX_BYTES - 2),
    ]:
        with subtests.test(arguments=arguments):
            check_arguments(arguments)


def test_deeper_arguments_are_refused(subtests) -> None:
    for arguments in [
        lists(MAX_DEPTH + 1, 1),
        objects(MAX_DEPTH + 1, "x"),
        lists(MAX_DEPTH, {}),
        objects(MAX_DEPTH, []),
        [1, "x", objects(MAX_DEPTH // 2, lists(MAX_DEPTH // 2, None))],
        objects(5_000, 1),
    ]:
        with (
            subtests.test(arguments=arguments),
            pytest.raises(SubmissionError, match="more than 20 lists or objects inside each other"),
        ):
            check_arguments(arguments)


def test_larger_arguments_are_refused() -> None:
    with pytest.raises(SubmissionError, match="65,537 bytes"):
        check_arguments("x" * (MAX_BYTES - 1))
