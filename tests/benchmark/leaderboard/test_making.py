from buildarena_benchmark.leaderboard import making, summaries_made_by


def test_any_file_of_the_library_may_change_summaries(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(making, "files", lambda _: tmp_path)
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / "a.yaml").write_text("one")
    (tmp_path / "b.py").write_text("two")
    found = [making.summaries_made_by.__wrapped__()]
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "b.pyc").write_text("compiled")
    assert making.summaries_made_by.__wrapped__() == found[0]
    (tmp_path / "tasks" / "a.yaml").write_text("three")
    found.append(making.summaries_made_by.__wrapped__())
    (tmp_path / "b.py").rename(tmp_path / "c.py")
    found.append(making.summaries_made_by.__wrapped__())
    monkeypatch.setattr(making.np, "__version__", "another")
    found.append(making.summaries_made_by.__wrapped__())
    assert len({*found}) == 4


def test_it_is_of_the_library_itself() -> None:
    names = [name for name, _ in making._files(making.files("buildarena_benchmark"), "")]
    assert {"/leaderboard/cells.py", "/statistics/means.py", "/tasks/references.json"} <= {*names}
    assert summaries_made_by() == summaries_made_by()
