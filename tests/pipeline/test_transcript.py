from __future__ import annotations

from buildarena_pipeline.transcript import ActionResult, ModelTurn, Transcript
from buildarena_pipeline.turns import turn_of_call
from buildarena_store import ExternalCall

ACTION = ActionResult(
    name="start", arguments={"n": [1, "ü"]}, ok=False, reason="block_presence", feedback="No."
)


def test_a_models_transcript_has_no_blanks_and_tells_what_each_turn_cost() -> None:
    turn = ModelTurn(
        index=0,
        stage="build",
        sub_structure=None,
        role="builder",
        text="",
        actions=(ACTION,),
        finish="stop",
        input_tokens=10,
        output_tokens=5,
        cost_usd="0.000001",
        latency_s=1.0,
        tries=1,
    )
    assert Transcript([turn]).to_json().decode() == (
        '{"version":"1","turns":[{"index":0,"stage":"build","sub_structure":null,"role":"builder",'
        '"text":"","actions":[{"name":"start","arguments":{"n":[1,"ü"]},"ok":false,'
        '"reason":"block_presence","feedback":"No."}],"finish":"stop","input_tokens":10,'
        '"output_tokens":5,"cost_usd":"0.000001","latency_s":1.0,"tries":1}]}'
    )


def test_an_external_agents_transcript_has_blanks_and_no_costs() -> None:
    call = ExternalCall(
        machine="main",
        tool="start",
        arguments={"n": [1, "ü"]},
        ok=False,
        reason="block_presence",
        feedback="No.",
    )
    transcript = Transcript([turn_of_call(0, call)])
    assert transcript.to_json(spaced=True).decode() == (
        '{"version": "1", "turns": [{"index": 0, "stage": "external", "sub_structure": "main", '
        '"role": "agent", "text": "", "actions": [{"name": "start", "arguments": {"n": [1, "ü"]}, '
        '"ok": false, "reason": "block_presence", "feedback": "No."}]}]}'
    )
    assert (transcript.actions, transcript.refusals) == (1, {"block_presence": 1})
