from __future__ import annotations

import pytest

from buildarena_worker.workflow.plan import PlanError, read_plan

GOOD = """<building_plan><overall_structure>all</overall_structure><sub_structures>
<sub_structure><name>deck</name><description>flat & long</description></sub_structure>
<sub_structure><name>tower</name><function>holds < ropes</function></sub_structure>
</sub_structures></building_plan>"""


def test_a_plan_is_found_among_other_words() -> None:
    plan = read_plan(f"Thinking…\n{GOOD}\nDone.")
    assert [part.name for part in plan.sub_structures] == ["deck", "tower"]
    assert plan.sub_structures[0].text == "- description: flat & long"
    assert plan.overall == "all"


def test_the_last_plan_counts() -> None:
    assert read_plan(GOOD.replace("deck", "draft") + GOOD).sub_structures[0].name == "deck"


def test_what_is_missing_is_said(subtests) -> None:
    for text, says in [
        ("", "no <building_plan>"),
        ("<building_plan></building_plan>", "no <sub_structure>"),
        (GOOD.replace("overall_structure", "overall"), "no <overall_structure>"),
        (GOOD.replace("<name>deck</name>", ""), "sub-structure 1 has no <name>"),
        (GOOD.replace("tower", "deck"), "'deck' stands for several"),
        (GOOD.replace("<function>holds < ropes</function>", ""), "'tower' says nothing"),
    ]:
        with subtests.test(text=text), pytest.raises(PlanError, match=says):
            read_plan(text)
