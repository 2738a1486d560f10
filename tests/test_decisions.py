"""Decisions have one form, and their index tells of each."""

import re
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "docs" / "decisions"
HEAD = re.compile(
    r"# (?P<title>.+)\n\nDate: (?P<date>\d{4}-\d\d-\d\d) · "
    r"Status: (?P<status>accepted|superseded by \[.+\]\(.+\.md\))\n\n"
)


def test_the_index_tells_title_date_and_status_of_each() -> None:
    rows = re.findall(
        r"^\| \[(.+)\]\((.+)\) \| (\S+) \| (.+) \|$",
        (FOLDER / "README.md").read_text(),
        re.MULTILINE,
    )
    decisions = sorted(file for file in FOLDER.glob("*.md") if file.name != "README.md")
    heads = {file.name: HEAD.match(file.read_text()) for file in decisions}
    assert not [name for name, head in heads.items() if head is None]
    assert sorted(rows, key=lambda row: row[1]) == [
        (head["title"], name, head["date"], head["status"]) for name, head in heads.items() if head
    ]
