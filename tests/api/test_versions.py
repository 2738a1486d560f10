"""What results depend on, as the page on the method shows it."""

from buildarena_benchmark.statistics import MIN_SUCCESSES
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_pipeline import __version__
from buildarena_pipeline.catalog.specs import JobSpec


def test_the_versions_in_use_are_those_of_a_new_jobs_track(api, submissions) -> None:
    used = api.get("/v1/versions").json()
    job, _ = submissions.submit_job(JobSpec(task="lift-1", model="builtin/idle", seed=0))
    simulators = {one["name"]: one["version"] for one in used["simulators"]}
    name = job.track_config["simulator"]
    assert simulators[name] == job.track_config["simulation_version"]
    assert used["feedback"] == job.track_config["feedback_version"] == FEEDBACK_VERSION
    assert (used["buildarena"], used["min_successes"]) == (__version__, MIN_SUCCESSES)
    assert used["error"] == 0.05
