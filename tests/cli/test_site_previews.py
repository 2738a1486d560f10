"""What programs that make previews read of a site, whatever names are in it."""

from html.parser import HTMLParser

from buildarena_cli.site.pages import INDEX, first_page
from buildarena_cli.site.previews import best_picture, head, job_preview

JOB = {
    "id": "job_1",
    "task": "support-1",
    "model": 'agent/"><script>alert(1)</script>',
    "seed": 3,
    "reason": None,
    "outcome": "success",
    "success": True,
    "indicator": 1234.5,
}


class Read(HTMLParser):
    """The elements of a page, with what they say."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.told: dict[str, str] = {}
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        said = dict(attrs)
        name = said.get("property") or said.get("name") or said.get("http-equiv")
        if tag == "meta" and name:
            self.told[name] = said["content"] or ""
        if tag == "a":
            self.told["link"] = said["href"] or ""


def test_a_job_has_a_page_that_leads_on_to_it() -> None:
    read = Read(job_preview(JOB, "data/ab/cd.png"))
    assert "script" not in read.elements
    assert read.told["og:title"] == f"support-1 by {JOB['model']}, seed 3"
    assert read.told["og:description"] == "success, 1,234.50"
    assert read.told["og:image"] == "../data/ab/cd.png"
    assert read.told["refresh"] == f"0; url={read.told['link']}"
    assert read.told["link"] == "../#/jobs/job_1"
    assert "og:image" not in Read(job_preview(JOB, None)).told


def test_the_first_page_says_what_the_site_holds(tmp_path) -> None:
    (tmp_path / INDEX).write_text(
        '<head><meta charset="utf-8" /><script src="/scheme.js"></script></head>'
    )
    read = Read(first_page(tmp_path, head("BuildArena", r'It holds "\1"', "data/a.png")))
    assert read.told["description"] == r'It holds "\1"'
    assert read.told["buildarena-site"] == "site.json"


def test_its_picture_is_of_the_best_job_that_has_one() -> None:
    jobs = [
        {"id": "a", "success": False},
        {"id": "b", "success": True},
        {"id": "c", "success": True},
    ]
    stored = {job: {f"/v1/jobs/{job}/thumbnail.png": f"data/{job}.png"} for job in "ac"}
    assert best_picture(jobs, stored) == "data/c.png"
    assert best_picture(jobs, {}) is None
