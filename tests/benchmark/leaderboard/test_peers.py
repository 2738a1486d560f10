"""What other benchmarks published, beside the tasks most like theirs."""

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import peer_rows


def test_each_row_stands_beside_a_task_of_ours_with_its_own_name() -> None:
    assert set(peer_rows()) == {"throw-1", "transport-1"} <= set(builtin_tasks())
    for rows in peer_rows().values():
        assert len({(row.peer, row.peer_task) for row in rows}) == 1
        assert len({(row.model, row.workflow) for row in rows}) == len(rows) == 24
        assert all(row.indicator_mean <= row.indicator_best for row in rows)
        assert all(row.indicator_std >= 0 for row in rows)


def test_the_best_catapult_is_the_one_that_is_quoted() -> None:
    rows = peer_rows()["throw-1"]
    assert max(row.indicator_mean for row in rows) == 9.83
    assert max(row.indicator_best for row in rows) == 21.95
