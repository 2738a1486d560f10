from __future__ import annotations

import pytest
from support.servers.stacks import wait_until

from buildarena_cli.local import EmbeddedValkey
from buildarena_pipeline.broker.queues import ENOUGH_WAITING, Queues


@pytest.mark.ci
def test_messages_are_sent_again_when_the_broker_is_back(tmp_path) -> None:
    valkey = EmbeddedValkey(tmp_path / "valkey", tmp_path / "valkey.log")
    process = valkey.start()
    queues = Queues(valkey.url)
    try:
        assert queues.notify("construct", ["job_1"])
        assert queues.waiting("construct") == 1
        valkey.stop(process)
        assert not queues.notify("construct", ["job_2"])
        assert queues.waiting("construct") is None
        process = valkey.start()
        wait_until(lambda: queues.waiting("construct") is not None, 10, "the broker is back")
        before = queues.waiting("construct")
        for _ in range(2):
            assert queues.notify("construct", ["job_3"])
        assert queues.waiting("construct") == before + 2
    finally:
        queues.close()
        valkey.stop(process)


def test_a_message_is_left_out_where_enough_wait(context) -> None:
    context.queues.notify_one("construct", "job_1")
    assert context.queues.settle()
    assert context.queues.waiting("construct") == 1
    context.queues.notify("construct", ["job_2"] * ENOUGH_WAITING)
    context.queues.notify_one("construct", "job_3")
    assert context.queues.settle()
    assert context.queues.waiting("construct") == ENOUGH_WAITING + 1
