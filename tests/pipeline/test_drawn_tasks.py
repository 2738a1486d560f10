"""Jobs have the task that their seed draws, wherever it is asked for."""

from types import SimpleNamespace

from buildarena_benchmark import broken_constraint, builtin_tasks
from buildarena_benchmark.families.given import given_machine
from buildarena_pipeline.agents.workbench import bench_of, rebuild
from buildarena_pipeline.replays.from_turns import replay_of_turns
from buildarena_pipeline.runtime.scoring import task_of

TASK = builtin_tasks()["repair-1"]


def test_a_jobs_task_is_drawn_by_its_seed() -> None:
    catalogue = SimpleNamespace(exact=lambda *_: TASK)
    for seed in (0, 3, 2**53 - 1):
        job = SimpleNamespace(task=TASK.name, task_version=TASK.version, seed=seed)
        assert task_of(job, catalogue) == TASK.drawn(seed)
        machine = given_machine(TASK.beginning, seed)
        assert broken_constraint(task_of(job, catalogue), machine) is None


def test_calls_made_again_begin_with_the_same_machine() -> None:
    task = TASK.drawn(6)
    bench = bench_of(task, data_sheets=True)
    wheels = [b.id for b in given_machine(TASK.beginning, 6).blocks.values() if b.module.spins]
    calls = [bench.call("main", "flip_spin", {"block_id": wheel}) for wheel in wheels]
    assert [call.ok for call in calls].count(True) == 4
    again = rebuild(calls, task, data_sheets=True)
    assert again.submitted() == bench.submitted()
    turns = [
        {
            "index": number,
            "stage": "external",
            "sub_structure": call.machine,
            "actions": [
                {
                    "name": call.tool,
                    "arguments": call.arguments,
                    "ok": call.ok,
                    "reason": call.reason,
                    "feedback": call.feedback,
                }
            ],
        }
        for number, call in enumerate(calls)
    ]
    assert replay_of_turns(turns, task).machine == bench.submitted()
    assert replay_of_turns(turns).machine != bench.submitted()
