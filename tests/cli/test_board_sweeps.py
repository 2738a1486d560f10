"""The sweep files of the paper's experiments can be submitted as they are."""

from pathlib import Path

import pytest
import yaml

from buildarena_benchmark import parse_custom_task
from buildarena_benchmark.leaderboard import published_rows
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.catalog.specs import SweepSpec

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = sorted((EXAMPLES / "sweeps").glob("*.yaml"))


@pytest.fixture(autouse=True)
def custom_tasks(context) -> None:
    """The tasks that come as examples, uploaded."""
    for file in (EXAMPLES / "tasks").glob("*.yaml"):
        text = file.read_text()
        context.tasks.add(parse_custom_task(text, origin=file.name), text)


def spec_of(file: Path) -> SweepSpec:
    return SweepSpec.model_validate(yaml.safe_load(file.read_text()))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_sweep_file_names_what_there_is(submissions, file) -> None:
    spec = spec_of(file)
    jobs = submissions.plan(spec)
    assert len(jobs) == len(spec.tasks) * len(spec.models) * len(spec.all_seeds())


def test_the_main_grid_is_the_papers(submissions) -> None:
    main, more = (
        spec_of(FILES[0].with_name(f"{name}.yaml")) for name in ("main-grid", "open-weight-models")
    )
    assert len(submissions.plan(main)) == 5184
    registry = load_registry()
    snapshots = {registry.models[name].model for name in [*main.models, *more.models]}
    assert snapshots == {row.snapshot for rows in published_rows().values() for row in rows}


def test_files_of_one_ablation_differ_in_one_thing_and_share_seeds(subtests) -> None:
    for group in ["workflow", "decoding", "prompting", "simulators"]:
        with subtests.test(group=group):
            specs = [spec_of(file) for file in FILES if file.stem.startswith(group)]
            assert len(specs) >= 2
            shown = [spec.model_dump(mode="json", exclude={"name"}) for spec in specs]
            different = {name for name in shown[0] if len({str(each[name]) for each in shown}) > 1}
            assert len(different) == 1, different
            assert len({(*spec.tasks, *spec.models, *spec.all_seeds()) for spec in specs}) == 1
