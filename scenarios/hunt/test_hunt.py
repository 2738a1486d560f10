"""The search finds what can be found, says so, and does the same again."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scenarios.hunt import run as hunt
from scenarios.hunt.confirming import Order, confirmed
from scenarios.hunt.evidence import Evidence
from scenarios.hunt.gallery import Gallery
from scenarios.hunt.search import Crew, TaskSearch
from scenarios.hunt.seeds import expert_genome, exploits, seeds_of
from scenarios.hunt.suspicion import suspicions
from scenarios.hunt.trial import tried
from scenarios.hunt.variation.genome import IDLE, Genome, grown, kind_of
from scenarios.hunt.variation.mutation import crossed, mutated
from support.machines.building import KeyedDraft
from support.machines.headroom import drafted

from buildarena_benchmark import broken_constraint, builtin_tasks, score
from buildarena_benchmark.experts.drafting import EAST, SOUTH, UP, WEST
from buildarena_benchmark.tasks.courses.expert import courier
from buildarena_geometry import Machine
from buildarena_simulation import simulate

pytestmark = pytest.mark.nightly

START = Genome(actions=[{"op": "start", "params": {}, "makes": "1"}])
GENERATIONS = 6


def stored(name: str) -> Genome:
    return next(exploit.genome for exploit in exploits() if exploit.name == name)


def naive(task, machine, trajectory):
    """A scorer that forgot the rule of spanning."""
    result = score(task, machine, trajectory)
    lasted = result.metrics["time_above_s"] >= task.scoring.min_time_s
    load = float(result.metrics["load_when_decided"]) if lasted else 0.0
    flags = tuple(flag for flag in result.flags if flag != "does_not_span")
    return replace(result, success=lasted, indicator=load, flags=flags)


def searched(scorer, generations: int = GENERATIONS) -> TaskSearch:
    """A short search from nothing but a starting block and one block on it."""
    search = TaskSearch("support-3", seed=3, scorer=scorer)
    block = {"op": "attach_block_to", "params": {"base_block": "1", "face": "A"}}
    block["params"]["new_block"] = "Small Wooden Block"
    with Crew(1) as crew:
        search.begin(crew, [Genome(actions=[*START.actions, block])])
        for _ in range(generations):
            search.advance(crew, batch=10)
            if search.elites[0].success:
                break
    return search


def test_the_search_finds_a_planted_hole_and_its_checks_name_it() -> None:
    best = searched(naive).elites[0]
    assert best.success
    assert "reaches no terrain" in best.suspicions
    closed = tried("support-3", best.genome)
    assert closed is not None
    assert not closed.success


def test_a_search_with_the_same_seed_is_the_same_whoever_does_the_work() -> None:
    def elites(workers: int) -> list[dict[str, object]]:
        search = TaskSearch("lift-1", seed=5)
        with Crew(workers) as crew:
            search.begin(crew, seeds_of("lift-1")[:4])
            search.advance(crew, batch=6)
        return [found.as_json() for found in search.elites]

    assert elites(1) == elites(2)


def test_genomes_survive_mutation_and_crossing() -> None:
    for task in ("transport-2", "lift-3"):
        kind = kind_of(task)
        pool = seeds_of(task)
        draw = np.random.default_rng(1)
        made = set()
        for _ in range(15):
            first, second = (pool[int(k)] for k in draw.integers(len(pool), size=2))
            child = mutated(crossed(first, second, draw), kind, draw)
            machine, again = grown(child)
            assert again.as_json() == child.as_json()
            assert grown(Genome.from_json(child.as_json()))[0] == machine
            made.add(child.key)
        assert len(made) > 10


def test_actions_that_are_taken_out_leave_the_rest_meaning_the_same() -> None:
    genome = grown(stored("support-tower-narrow"))[1]
    turned = [*genome.actions[:2], *genome.actions[3:]]
    machine, shorter = grown(Genome(actions=turned))
    assert len(machine.blocks) == 2
    assert len(shorter.actions) == 2
    side = {"op": "attach_block_to", "params": {"base_block": "1", "face": "B"}, "makes": "x"}
    side["params"]["new_block"] = "Small Wooden Block"
    machine, longer = grown(Genome(actions=[genome.actions[0], side, *genome.actions[1:]]))
    assert len(machine.blocks) == 5
    assert longer.actions[3]["params"]["base_block"] == "3"


def test_what_no_trial_would_be_granted_is_no_finding() -> None:
    assert tried("lift-2", stored("lift-loose-cannon")) is None
    assert tried("support-1", START) is None


@pytest.mark.parametrize(
    ("name", "check"),
    [
        ("support-tower", "reaches no terrain"),
        ("support-cross-and-column", "higher than long"),
        ("transport-toppling-tower", "falls over"),
        ("transport-mast-over-burnout", "taller than its way"),
        ("lift-opposed-cannons", "pushes aside"),
    ],
)
def test_checks_name_past_exploits_without_any_rule(name, check) -> None:
    task = next(exploit.task for exploit in exploits() if exploit.name == name)

    def lenient(*trial):
        return replace(score(*trial), success=True, flags=())

    found = tried(task, stored(name), lenient)
    assert found is not None
    assert check in found.suspicions


def car_with_boulder() -> Machine:
    """A car that carries its boulder north and brakes at the line."""
    draft = KeyedDraft(modules="all")
    start = draft.start()
    beam = draft.row(start, SOUTH, 3)
    for base in (start, beam[-1]):
        for side in (EAST, WEST):
            draft.bind(draft.wheel(base, side), "spinning_forward", "UpArrow")
    draft.attach(draft.attach(beam[1], UP, "Bomb Holder"), UP, "Boulder")
    draft.press("UpArrow", 1.0, 3.0)
    return draft.machine


def _dropped() -> Machine:
    """A boulder that rolls off a beam without a key."""
    draft = KeyedDraft(modules="all")
    draft.attach(draft.row(draft.start(), EAST, 1)[-1], UP, "Boulder")
    return draft.machine


def _pushed() -> Machine:
    """A car that kicks its ball and lets it roll."""
    return drafted(courier(0), [(0.4, "UpArrow", 1.0)])


@pytest.mark.parametrize(
    ("task", "machine", "check"),
    [
        ("throw-1", car_with_boulder, "travels"),
        ("throw-1", _dropped, "no key before it flies"),
        ("deliver-2", _pushed, "cargo runs ahead"),
    ],
)
def test_checks_name_what_throws_and_brings_in_another_way(task, machine, check) -> None:
    known, built = builtin_tasks()[task], machine()
    trajectory = simulate(built, known.scenario, "mujoco")
    found = Evidence(known, built, {"mujoco": (score(known, built, trajectory), trajectory)})
    assert check in suspicions(found)


@pytest.mark.parametrize("task", ["throw-1", "deliver-2", "drive-4"])
def test_checks_find_nothing_odd_in_the_experts(task) -> None:
    found = tried(task, expert_genome(task))
    assert found is not None
    assert (found.success, found.suspicions) == (True, ())


def test_a_gallery_is_resumed_and_its_machines_can_be_opened(tmp_path, capsys) -> None:
    arguments = ["--minutes", "0.001", "--tasks", "lift-1", "--workers", "1", "--confirm", "1"]
    arguments += ["--gallery", str(tmp_path)]
    hunt.main(arguments)
    first = capsys.readouterr().out
    archive = json.loads((tmp_path / "archives" / "lift-1.json").read_text())
    assert Gallery(tmp_path).elites("lift-1")[0].key == archive["elites"][0]["key"]
    assert "best of lift" in first
    assert "# What the hunt found" in (tmp_path / "index.md").read_text()


def test_a_confirmed_machine_has_scores_of_both_engines_and_a_picture(tmp_path) -> None:
    gallery = Gallery(tmp_path)
    genome = Genome.from_json(grown(seeds_of("lift-1")[1])[1].as_json())
    key = genome.key
    found = confirmed(Order(task="lift-1", genome=genome, picture=gallery.picture("lift-1", key)))
    gallery.write_confirmed(found)
    assert set(found.scores) == {"mujoco", "pybullet"}
    assert gallery.picture("lift-1", key).stat().st_size > 1000
    kept = json.loads(gallery.picture("lift-1", key).with_suffix(".json").read_text())
    assert (kept["scores"], Genome.from_json(kept)) == (found.scores, genome)
    page = gallery.write_index([found]).read_text()
    assert ("| [lift-1-" in page) == found.success


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--minutes", "0"], "0 minutes are no time"),
        (["--tasks", "support-9"], "invalid choice: 'support-9'"),
    ],
)
def test_wrong_options_are_named(arguments, says, capsys) -> None:
    with pytest.raises(SystemExit):
        hunt.main(arguments)
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("name", builtin_tasks())
def test_every_task_has_seeds_that_may_be_tried(name) -> None:
    task = builtin_tasks()[name]
    assert any(broken_constraint(task, grown(seed)[0]) is None for seed in seeds_of(name))


@pytest.mark.parametrize(
    "task",
    {(task.scorer, kind_of(name)): name for name, task in builtin_tasks().items()}.values(),
)
def test_machines_of_every_scorer_and_kind_can_be_hunted(task) -> None:
    draw = np.random.default_rng(4)
    pool = seeds_of(task)
    child = mutated(crossed(pool[-1], pool[0], draw), kind_of(task), draw)
    machine, _ = grown(child)
    assert machine.started
    finding = tried(task, pool[-1])
    assert finding is None or finding.objective >= -1.0


def test_checks_name_a_program_that_looks_at_nothing() -> None:
    expert = expert_genome("balance-2")
    honest = tried("balance-2", expert)
    assert honest is not None
    assert honest.success
    assert not honest.suspicions
    task = builtin_tasks()["balance-2"]
    easy = replace(task, scoring=task.scoring.model_copy(update={"min_s": 0.04}))
    machine = grown(expert)[0].with_controller(IDLE)
    trajectory = simulate(machine, task.scenario, "mujoco")
    odd = suspicions(
        Evidence(easy, machine, {"mujoco": (score(easy, machine, trajectory), trajectory)})
    )
    assert {"needs no program", "looks at nothing"} <= set(odd)


def test_programs_are_changed_and_stay_with_their_machines() -> None:
    draw, first, second = np.random.default_rng(2), *map(expert_genome, ("hover-4", "landing-2"))
    programs = {mutated(first, "control", draw).program for _ in range(12)}
    assert len(programs) > 4
    child = crossed(first, second, draw)
    assert child.program in {first.program, second.program}
    assert grown(Genome.from_json(child.as_json()))[0].controller == child.program
