"""Boards of chosen categories, and what the ranking over all tasks is over."""

import pytest

from buildarena_api.leaderboard.filters import _ranked_over
from buildarena_benchmark import builtin_tasks, paper_tasks

FAMILIES = {"budget-1", "repair-1", "identify-1"}
CONTROL = {
    *("landing-1", "landing-2", "slalom-2", "hover-3", "hover-4"),
    *("balance-1", "balance-2", "walk-1", "walk-2", "place-2", "line-1"),
}
THROWING = {f"throw-{level}" for level in (1, 2, 3, 4, 5)}
COURSES = {
    *(f"deliver-{level}" for level in (1, 2, 3)),
    *(f"drive-{level}" for level in (1, 2, 3, 4)),
    "fetch-1",
}
WORKSHOP = {*(f"mechanisms-{level}" for level in (1, 2, 3, 4)), "flight-1", "flight-2"}
SPACE = {"orbit-1", "orbit-2"}
OTHERS = WORKSHOP | FAMILIES | CONTROL | THROWING | SPACE | COURSES


def test_an_unknown_category_is_refused_with_those_that_there_are(api) -> None:
    answer = api.get("/v1/leaderboard", params={"category": "garage"})
    assert answer.status_code == 422
    assert {"flight", "mechanisms", "lift"} <= set(answer.json()["errors"][0]["choices"])
    assert api.get("/v1/leaderboard", params={"category": "flight"}).status_code == 200


@pytest.mark.parametrize(
    ("task", "category", "names"),
    [
        (None, None, set(paper_tasks())),
        (None, ["flight"], {"flight-1", "flight-2"}),
        (None, ["mechanisms", "flight"], WORKSHOP),
        (None, ["headroom"], set(builtin_tasks()) - set(paper_tasks()) - OTHERS),
        (None, ["families"], FAMILIES),
        (None, ["control"], CONTROL),
        (None, ["throwing"], THROWING),
        (None, ["space"], SPACE),
        (None, ["courses"], COURSES),
        (None, ["support"], {"support-1", "support-2", "support-3"}),
        (["support-1"], ["flight"], None),
    ],
)
def test_what_the_overall_ranking_is_over(task, category, names) -> None:
    assert _ranked_over(task, category) == names
