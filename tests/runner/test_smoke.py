from runner_rig import ended, runner_key, slot, submitted


def test_a_runner_does_a_job(context, submissions, url) -> None:
    job = submitted(context, submissions)
    with slot(url, runner_key(context)[1]) as one:
        assert one.do_next(0)
        assert not one.do_next(0)
    assert ended(context, job).outcome == "success"
