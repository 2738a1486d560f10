"""The commands of tasks: check without a server, add, list, show."""

import json
from pathlib import Path

import pytest
from support.clients.commands import printed, run, run_cli
from support.jobs import finish

from buildarena_api.routes.tasks import EXAMPLE

OTHER = EXAMPLE.replace("final_mass: 200", "final_mass: 300")
WRONG = EXAMPLE.replace("gap: 3}", "gap: -3}").replace("{name: support}", "{name: suport}")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.yaml"
    path.write_text(EXAMPLE)
    return path


def test_a_good_file_is_checked_without_a_server(file) -> None:
    done = run("task", "check", str(file))
    assert done.returncode == 0
    assert "narrow-gap, version " in done.stdout
    answer = json.loads(run("task", "check", str(file), "--json").stdout)
    assert (answer["ok"], answer["name"], answer["errors"]) == (True, "narrow-gap", [])


def test_check_and_add_say_the_same_faults(url, file) -> None:
    for text, says in (
        (WRONG, [f"{file}:12: scenario.placement.gap: ", f"{file}:13: scoring: "]),
        ("a: &a [x]\nb: *a\n", [f"{file}:1: anchors and aliases"]),
        (EXAMPLE.replace("narrow-gap", "lift-1"), [f"{file}:1: name: lift-1 is a built-in task"]),
    ):
        file.write_text(text)
        checked, added = run("task", "check", str(file)), run_cli(url, "task", "add", str(file))
        assert checked.returncode == added.returncode == 1
        assert checked.stderr == added.stderr
        for part in says:
            assert part in checked.stderr
    file.write_text(WRONG)
    done = run("task", "check", str(file), "--json")
    answer = json.loads(done.stdout)
    assert (done.returncode, answer["ok"]) == (1, False)
    assert [(e["line"], e["field"]) for e in answer["errors"]] == [
        (12, "scenario.placement.gap"),
        (13, "scoring"),
    ]


def test_a_missing_file_is_reported(url, tmp_path) -> None:
    for words in (["check"], ["add", "--url", url]):
        done = run("task", words[0], str(tmp_path / "nowhere.yaml"), *words[1:])
        assert done.returncode == 2
        assert "nowhere.yaml: No such file" in done.stderr


def test_an_added_task_is_listed_with_a_mark_and_shown(url, file) -> None:
    first = json.loads(printed(url, "task", "add", str(file), "--json"))
    assert (first["name"], first["custom"]) == ("narrow-gap", True)
    text = printed(url, "task", "list")
    assert "narrow-gap+" in text
    assert "support-1+" not in text
    listed = json.loads(printed(url, "task", "list", "--json"))
    marks = {task["name"]: task["custom"] for task in listed}
    assert (marks["narrow-gap"], marks["support-1"]) == (True, False)
    shown = printed(url, "task", "show", "narrow-gap")
    assert f"narrow-gap, version {first['version']}, added by a user" in shown
    assert "carries a cargo of 200" in shown
    assert "built-in" in printed(url, "task", "show", "support-1")


def test_versions_are_kept_and_shown(url, file) -> None:
    old = json.loads(printed(url, "task", "add", str(file), "--json"))
    file.write_text(OTHER)
    new = json.loads(printed(url, "task", "add", str(file), "--json"))
    newest = json.loads(printed(url, "task", "show", "narrow-gap", "--json"))
    assert newest["version"] == new["version"]
    words = ["task", "show", "narrow-gap", "--version", old["version"], "--json"]
    kept = json.loads(printed(url, *words))
    assert kept["document"]["scenario"]["cargo"]["final_mass"] == 200
    file.write_text(EXAMPLE)
    again = run_cli(url, "task", "add", str(file))
    assert again.returncode == 0
    assert "new submissions get a newer one" in again.stderr


def test_a_task_that_is_not_there_is_reported_with_the_choices(url, file) -> None:
    run_cli(url, "task", "add", str(file))
    done = run_cli(url, "task", "show", "nowhere")
    assert done.returncode == 1
    assert "nowhere" in done.stderr
    assert "choose from transport-1" in done.stderr
    assert "narrow-gap" in done.stderr
    assert run_cli(url, "task", "show", "narrow-gap", "--version", "0" * 12).returncode == 1


def test_a_title_can_not_be_taken_for_markup(url, file) -> None:
    file.write_text(EXAMPLE.replace("A bridge over a gap of 3", '"[/red] [bold]gap"'))
    printed(url, "task", "add", str(file))
    assert "[/red] [bold]gap" in printed(url, "task", "list")


@pytest.fixture
def sweep_of_own(url, context, file) -> str:
    """A sweep of a custom task and a built-in one, ended."""
    printed(url, "task", "add", str(file))
    spec = file.with_name("sweep.yaml")
    spec.write_text(
        "name: mine\ntasks: [narrow-gap, lift-1]\n"
        "models: [openai/gpt-5, builtin/random]\nsamples: 3\n"
    )
    words = ["sweep", "run", str(spec), "--detach", "--json"]
    submitted = json.loads(printed(url, *words))["id"]
    while (lease := context.store.leases.claim("construct", owner="w")) is not None:
        won = lease.job.model == "openai/gpt-5"
        score = ("success", 150.0) if won else ("unsuccessful", 0.0)
        finish(context, lease, *score, metrics={"parts": 7})
    return str(submitted)


def test_a_leaderboard_of_own_tasks_alone_has_no_overall_table(url, sweep_of_own) -> None:
    assert sweep_of_own
    text = printed(url, "leaderboard")
    assert "narrow-gap: load in mass units" in text
    assert "Over lift-1\n" in text
    assert "Over lift-1" not in printed(url, "leaderboard", "--task", "narrow-gap")
