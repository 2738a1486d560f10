"""Tables: whole through a pipe; on a terminal, columns give way in their order and ids never do."""

import pytest
from support.clients.commands import printed
from support.clients.terminals import on_terminal, piped

from buildarena_cli.commands.job_lists import COLUMNS
from buildarena_cli.dataset.columns import JOBS
from buildarena_cli.terminal.output import columns, print_table
from buildarena_cli.terminal.progress import FAULTS
from buildarena_client.waiting import STOPPED
from buildarena_pipeline.catalog.specs import SweepSpec
from buildarena_store import Outcome, SweepState

WIDTHS = [200, 100, 80, 60, 40]
LEAVING = [c.name for c in sorted(COLUMNS, key=lambda c: c.leaves) if c.leaves]


@pytest.fixture(autouse=True)
def sweep(submissions) -> None:
    spec = SweepSpec(
        name="a sweep with a long name",
        tasks=["support-1", "transport-2"],
        models=["builtin/idle", "anthropic/claude-sonnet-4"],
        samples=2,
    )
    submissions.submit_sweep(spec)


@pytest.fixture
def ids(context) -> list[str]:
    return [job.id for job in context.store.jobs.page(limit=100)]


def test_a_pipe_gets_one_whole_line_for_each_row(url, ids) -> None:
    done = piped("job", "list", "--url", url, COLUMNS="40")
    head, *rows = done.stdout.splitlines()
    assert head.split() == [column.name for column in COLUMNS]
    assert [row.split()[0] for row in rows] == ids
    assert all("  construct queued  " in row for row in rows)
    assert "\x1b" not in done.stdout
    assert not set("│┃─━…") & set(done.stdout)


@pytest.mark.parametrize("width", WIDTHS)
def test_columns_give_way_in_their_order_and_ids_stay_whole(url, ids, width) -> None:
    code, shown = on_terminal(width, "job", "list", "--url", url, NO_COLOR="1")
    head, *rows = shown.splitlines()
    assert code == 0
    assert [row.split()[0] for row in rows[: len(ids)]] == ids
    assert max(map(len, [head, *rows[: len(ids)]])) <= width
    names = {column.name for column in COLUMNS}
    gone = [name for name in LEAVING if name not in head.split()]
    assert gone == LEAVING[: len(gone)]
    assert set(head.split()) == names - set(gone)
    if gone:
        assert rows[len(ids)].startswith("too narrow for: ")
    if width == 200:
        assert gone == []


def test_a_line_is_longer_than_the_terminal_before_an_id_breaks(url, ids) -> None:
    _, shown = on_terminal(12, "job", "list", "--url", url, NO_COLOR="1")
    assert shown.splitlines()[1 : len(ids) + 1] == ids


@pytest.mark.parametrize(
    ("environment", "styled"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_headings_are_bold_where_that_is_wanted(url, environment, styled) -> None:
    _, shown = on_terminal(100, "job", "list", "--url", url, **environment)
    assert ("\x1b[1m" in shown) is styled
    assert ("\x1b" in shown) is styled


def test_columns_say_the_width_when_they_are_set(url) -> None:
    _, shown = on_terminal(200, "job", "list", "--url", url, COLUMNS="40", NO_COLOR="1")
    assert shown.splitlines()[0] == "job"


def test_what_strangers_wrote_can_not_steer_the_terminal(capsys) -> None:
    print_table(columns("name"), [("\x1b[2J\x07two\nlines",), ("",)])
    assert capsys.readouterr().out.splitlines() == ["name", "\\x1b[2J\\x07two lines", "-"]


def test_wide_letters_keep_columns_aligned(capsys) -> None:
    print_table(columns("name", "n"), [("日本", "1"), ("abcd", "2")])
    assert capsys.readouterr().out.splitlines() == ["name  n", "日本  1", "abcd  2"]


def test_a_sweep_is_listed_with_its_progress(url, context) -> None:
    head, row = printed(url, "sweep", "list").splitlines()
    (sweep,) = context.store.sweeps.page(limit=2)
    assert head.split() == ["sweep", "name", "state", "ended", "jobs", "outcomes", "USD", "created"]
    assert row.split("  ")[0] == sweep.id
    assert "a sweep with a long name" in row


def test_states_and_outcomes_are_spelled_as_the_service_spells_them() -> None:
    assert set(FAULTS) <= set(Outcome)
    assert set(STOPPED) <= set(SweepState)


def test_a_datasets_columns_begin_with_what_people_read_first() -> None:
    first = [column.name for column in JOBS[:7]]
    assert first == ["job_id", "task", "model", "seed", "outcome", "success", "indicator"]
