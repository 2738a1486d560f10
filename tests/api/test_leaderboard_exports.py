import csv
import io

import pyarrow.parquet as pq
import pytest
from support.jobs import claim, finish

pytestmark = pytest.mark.ci


@pytest.fixture
def ended(api, context, sweep) -> None:
    api.post("/v1/sweeps", json=sweep)
    for outcome in ("success", "unsuccessful"):
        score = {"metrics": {"parts": 7}, "flags": ["unstable"] if outcome != "success" else []}
        finish(context, claim(context), outcome, 3.0, columns={"actions": 4}, **score)


def exported(api, kind: str) -> bytes:
    answer = api.get("/v1/leaderboard/export", params={"format": kind})
    assert answer.status_code == 200
    return answer.content


@pytest.mark.usefixtures("ended")
def test_csv_and_parquet_hold_the_same_rows(api) -> None:
    rows = list(csv.DictReader(io.StringIO(exported(api, "csv").decode())))
    table = pq.read_table(io.BytesIO(exported(api, "parquet"))).to_pylist()
    assert len(rows) == len(table) == 1
    for text, typed in zip(rows, table, strict=True):
        assert list(text) == list(typed)
        assert text["model"] == typed["model"]
        rate = typed["success_rate"]
        assert text["success_rate"] == ("" if rate is None else str(rate))
    (ours,) = table
    assert list(ours)[:4] == ["task", "model", "track", "task_version"]
    assert (ours["trials"], ours["success_rate"]) == (2, 0.5)


@pytest.mark.usefixtures("ended")
def test_latex_has_our_tables_and_the_papers(api) -> None:
    text = exported(api, "latex").decode()
    assert text.count(r"\begin{tabular}") == 4
    assert r"& builtin/idle & \textbf{7.0} & -- & -- & \textbf{50.0}" in text
    assert r"& GPT-5 & \textbf{40.1} & -- & -- & \textbf{85.9}" in text


@pytest.mark.parametrize("kind", ["csv", "parquet", "latex"])
def test_an_empty_board_is_an_empty_file(api, kind) -> None:
    body = exported(api, kind)
    if kind == "csv":
        assert len(body.decode().splitlines()) == 1
    if kind == "parquet":
        assert pq.read_table(io.BytesIO(body)).num_rows == 0
    if kind == "latex":
        assert b"NaN" not in body
