"""What stands in lists, and custom tasks: uploaded, refused with line and field, versioned."""

import json
import re
from collections import Counter

import yaml
from support.clients.tenants import new_tenant
from support.contract import contract
from support.jobs import report_worker

from buildarena_api.routes.tasks import EXAMPLE
from buildarena_backend import __version__
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.states import simulate_queue
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.statistics import MIN_SUCCESSES
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_simulation import SIMULATION_VERSION

YAML = {"Content-Type": "application/yaml"}
OTHER = EXAMPLE.replace("final_mass: 200", "final_mass: 300")
PATH = "/v1/tasks/narrow-gap"


def upload(api, text: str):
    return api.post("/v1/tasks", content=text.encode(), headers=YAML)


def test_a_task_is_added_shown_and_listed_once(api) -> None:
    answer = upload(api, EXAMPLE)
    assert answer.status_code == 201, answer.text
    made = answer.json()
    assert (made["name"], made["custom"], made["current"]) == ("narrow-gap", True, True)
    assert (made["indicator"], made["unit"]) == ("load", "mass units")
    assert made["created_at"] is not None
    shown = api.get(answer.headers["location"])
    assert shown.json() == made == api.get(PATH).json()
    placement = {"kind": "span", "gap": 3.0, "lowest_center": 6.0}
    assert shown.json()["document"]["scenario"]["placement"] == placement
    names = {task["name"]: task for task in api.get("/v1/tasks").json()["data"]}
    assert list(names)[:2] == ["transport-1", "transport-2"]
    assert [name for name, task in names.items() if task["custom"]] == ["narrow-gap"]
    # The same content, however it is written, changes nothing.
    respelled = yaml.safe_dump(yaml.safe_load(EXAMPLE), sort_keys=True)
    for text in (f"# a comment\n{respelled}", json.dumps(made["document"])):
        again = upload(api, text)
        assert (again.status_code, again.json()) == (200, made)
    copied = {**api.get("/v1/tasks/lift-1").json()["document"], "name": "my-lift"}
    # What can change a score is the same, whatever its name.
    copy = upload(api, json.dumps(copied)).json()
    assert copy["version"] == api.get("/v1/tasks/lift-1").json()["version"]


def test_a_changed_task_is_a_new_version_and_the_old_one_stays(api) -> None:
    old = upload(api, EXAMPLE).json()
    tags = {path: api.get(path).headers["etag"] for path in ("/v1/tasks", PATH)}
    for path, tag in tags.items():
        assert api.get(path, headers={"If-None-Match": tag}).status_code == 304
    new = upload(api, OTHER).json()
    assert old["version"] != new["version"]
    assert api.get(PATH, headers={"If-None-Match": tags[PATH]}).json() == new
    shown = api.get(PATH, params={"version": old["version"]}).json()
    assert shown == {**old, "current": False}
    assert api.get(PATH, params={"version": "0" * 12}).status_code == 404
    # The old content again is known, and says that it is not what new submissions get.
    again = upload(api, EXAMPLE)
    assert (again.status_code, again.json()["current"]) == (200, False)
    # Jobs, sweeps and sessions get the newest version.
    job = api.post("/v1/jobs", json={"task": "narrow-gap", "model": "builtin/idle"}).json()
    assert (job["task"], job["task_version"]) == ("narrow-gap", new["version"])
    sweep = {"tasks": ["support-1", "narrow-gap"], "models": ["builtin/idle"], "samples": 2}
    for path in ("/v1/sweeps", "/v1/sweeps/estimate"):
        assert api.post(path, json=sweep).json()["jobs"] == 4
    opened = api.post("/v1/sessions", json={"task": "narrow-gap", "agent": "me"}).json()
    assert opened["statement"] == new["statement"]


def test_a_bad_task_is_refused_with_line_and_field(api) -> None:
    for text, line, field, choice in (
        (EXAMPLE.replace("gap: 3}", "gap: -3}"), 12, "scenario.placement.gap", None),
        (EXAMPLE.replace("  duration_s", "  duration"), 7, "scenario.duration", "duration_s"),
        (EXAMPLE.replace("narrow-gap", "support-1"), 1, "name", None),
        ("# mine\n" + EXAMPLE.replace("narrow-gap", "lift-1"), 2, "name", None),
        (EXAMPLE + "title: again\n", 15, "title", None),
        *(("a: &a [x]\nb: *a\n", 1, "", None), ("a: [\n", 2, "", None), ("", None, "", None)),
    ):
        answer = upload(api, text)
        assert answer.status_code == 422
        (problem, *_) = (e for e in answer.json()["errors"] if e["field"] == field)
        assert problem["line"] == line
        assert choice is None or choice in problem["choices"]
    assert api.post("/v1/tasks", content=EXAMPLE.encode()).status_code == 415
    large = upload(api, EXAMPLE + "# " + "x" * 70_000)
    assert (large.status_code, "65,536" in large.json()["detail"]) == (413, True)
    strange = api.post("/v1/tasks", content=b"name: \xff", headers=YAML)
    assert (strange.status_code, strange.json()["errors"][0]["line"]) == (422, 1)
    assert not any(task["custom"] for task in api.get("/v1/tasks").json()["data"])


def test_only_its_owner_changes_a_task(guarded) -> None:
    ada, bob, reader = (new_tenant(guarded, "x", scope) for scope in ("submit", "submit", "read"))
    for who, text, status in (
        (reader, EXAMPLE, 403),
        (ada, EXAMPLE, 201),
        (bob, OTHER, 403),
        (bob, OTHER.replace("narrow-gap", "narrower-gap"), 201),
        (ada, OTHER, 201),
        (ada, EXAMPLE, 200),
    ):
        answer = who.ask("POST", "/v1/tasks", content=text.encode(), headers=YAML)
        assert answer.status_code == status, answer.text
    assert reader.ask("GET", PATH).status_code == 200


def test_the_contract_and_its_page_need_no_other_server(api) -> None:
    operations = (one for path in contract()["paths"].values() for one in path.values())
    names = Counter(operation["operationId"] for operation in operations)
    assert names.most_common(1)[0][1] == 1
    assert "submit_sweep" in names
    sources = re.findall(r'(?:src|href)="([^"]+)"', api.get("/docs").text)
    assert sources
    for source in sources:
        assert source.startswith("/")
        assert api.get(source).status_code == 200


def test_lists_hold_what_can_be_submitted(api, submissions) -> None:
    tasks = {task["name"]: task for task in api.get("/v1/tasks").json()["data"]}
    assert tasks.keys() == builtin_tasks().keys()
    assert tasks["support-1"]["indicator"]
    models = {model["name"]: model for model in api.get("/v1/models").json()["data"]}
    assert models["builtin/expert"]["baseline"]
    modules = {one["name"]: one for one in api.get("/v1/modules").json()["data"]}
    assert modules["Powered Wheel"]["size"] == [2, 2, 0.5]
    assert modules["Powered Wheel"]["actions"] == ["spinning_forward", "spinning_backward"]
    assert modules["Brace"]["size"] is None
    assert modules["Small Wooden Block"]["faces"] == list("ABCDEF")
    # Versions in use are those of a new job's track.
    used = api.get("/v1/versions").json()
    job, _ = submissions.submit_job(JobSpec(task="lift-1", model="builtin/idle", seed=0))
    simulators = {one["name"]: one["version"] for one in used["simulators"]}
    track = job.track_config
    assert simulators[track["simulator"]] == track["simulation_version"]
    assert used["feedback"] == track["feedback_version"] == FEEDBACK_VERSION
    assert (used["buildarena"], used["min_successes"]) == (__version__, MIN_SUCCESSES)
    assert used["family_wise_error_rate"] == 0.05


def test_simulators_are_our_engines_and_what_workers_announce(context, api) -> None:
    def listed() -> dict[str, dict[str, object]]:
        return {view["name"]: view for view in api.get("/v1/simulators").json()["data"]}

    ours = {"version": SIMULATION_VERSION, "kind": "engine", "deterministic": True}
    ours |= {"workers": 0, "available": False}
    names = ("pybullet", "mujoco")
    assert listed() == {n: {"name": n, "default": n == names[0], **ours} for n in names}
    spec = {"task": "support-1", "model": "builtin/idle", "simulator": "unity"}
    refused = api.post("/v1/jobs", json=spec)
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["choices"] == ["pybullet", "mujoco"]
    for number, name in enumerate(("unity", "unity", "mujoco")):
        versions = {"simulation": "7.1", "kind": "game", "deterministic": False}
        report_worker(context, f"worker-{number}", simulate_queue(name), versions=versions)
    unity, mujoco = listed()["unity"], listed()["mujoco"]
    assert (unity["version"], unity["kind"], unity["default"]) == ("7.1", "game", False)
    assert (unity["workers"], unity["available"]) == (2, True)
    assert (mujoco["version"], mujoco["available"]) == (SIMULATION_VERSION, True)
    assert api.post("/v1/jobs", json=spec).status_code == 201
