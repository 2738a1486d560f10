from __future__ import annotations

from buildarena_cli.local import EmbeddedValkey
from buildarena_pipeline.broker.queues import PLENTY, Queues


def test_messages_are_sent_again_when_the_broker_is_back(tmp_path) -> None:
    valkey = EmbeddedValkey(tmp_path / "valkey", tmp_path / "valkey.log")
    process = valkey.start()
    queues = Queues(valkey.url)
    try:
        assert queues.announce("construct", ["job_1"])
        assert queues.waiting("construct") == 1
        valkey.stop(process)
        assert not queues.announce("construct", ["job_2"])
        assert queues.waiting("construct") is None
        process = valkey.start()
        before = queues.waiting("construct")
        assert before is not None
        for _ in range(2):
            assert queues.announce("construct", ["job_3"])
        assert queues.waiting("construct") == before + 2
    finally:
        queues.close()
        valkey.stop(process)


def test_a_nudge_is_left_out_where_messages_are_plenty(context) -> None:
    context.queues.nudge("construct", "job_1")
    assert context.queues.waiting("construct") == 1
    context.queues.announce("construct", ["job_2"] * PLENTY)
    context.queues.nudge("construct", "job_3")
    assert context.queues.waiting("construct") == PLENTY + 1
