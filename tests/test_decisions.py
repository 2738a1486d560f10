"""Decisions have one form and consecutive numbers, and their index tells of each."""

import re
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "docs" / "decisions"
HEAD = re.compile(
    r"# (?P<title>(?P<number>\d+)\. .+)\n\nDate: (?P<date>\d{4}-\d\d-\d\d) · "
    r"Status: (accepted(?:, replaces .+)?|superseded by \[.+\]\(.+\.md\))\n\n"
)


def test_the_index_tells_of_each_decision_in_the_order_of_their_numbers() -> None:
    index = (FOLDER / "README.md").read_text()
    rows = re.findall(r"^\| \[(.+)\]\((.+)\) \| .+ \| (\S+) \|$", index, re.MULTILINE)
    files = sorted(file for file in FOLDER.glob("*.md") if file.name != "README.md")
    heads = {file.name: HEAD.match(file.read_text()) for file in files}
    assert not [name for name, head in heads.items() if head is None]
    assert rows == [(head["title"], name, head["date"]) for name, head in heads.items() if head]
    numbers = range(1, len(files) + 1)
    assert [name[:5] for name in heads] == [f"{number:04}-" for number in numbers]
    assert [int(head["number"]) for head in heads.values() if head] == list(numbers)
