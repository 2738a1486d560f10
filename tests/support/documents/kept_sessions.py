"""Plays the kept sessions of tests/data/sessions again and writes what they read now.

Run it after an intended change of prompts, tools or answers: `make kept-sessions`. Built-in models
are asked again; other replies are those that were kept.
"""

import json
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any

from support.player import Played, Player
from support.providers.scripted import Scripted

from buildarena_geometry.machine_files import machine_bytes
from buildarena_worker.session.messages import Completion, ToolCall
from buildarena_worker.workflow.rounds import Loop

FOLDER = Path(__file__).parents[2] / "data/sessions"
SCRIPTED = "scripted-failures"
NAMES = sorted(p.stem for p in FOLDER.glob("*.json") if not p.stem.endswith(".transcript"))


def completion(reply: dict[str, Any]) -> Completion:
    """A reply of a journal."""
    calls = tuple(ToolCall(id=id_, name=name, arguments=a) for id_, name, a in reply["calls"])
    return Completion(text=reply["text"], calls=calls, finish=reply["finish"])


def written(name: str, kept: dict[str, Any], rollouts: list[Any], described: Any) -> None:
    """Plays a session from its beginning and writes it.

    Args:
        name: Its name.
        kept: What was kept of it.
        rollouts: Its rollouts, as the store has them.
        described: Makes a result's form in the file.
    """
    scripted = name == SCRIPTED
    client = Scripted(*(completion(e["reply"]) for e in kept["journal"])) if scripted else None
    played: Played = Player()(
        kept["model"],
        task=kept["task"],
        seed=kept["seed"],
        workflow=kept["workflow"],
        loop=Loop(**kept["loop"]),
        limits=kept["limits"],
        rollouts=rollouts,
        client=client,
    )
    machine, transcript = played.session.machine, played.session.transcript
    kept |= {
        "result": described(played.result),
        "machine": None if machine is None else sha256(machine_bytes(machine)).hexdigest(),
        "refusals": transcript.refusals,
        "journal": [json.loads(json.dumps(asdict(e), default=str)) for e in played.entries],
    }
    text = json.dumps(kept, indent=1, ensure_ascii=False) + "\n"
    (FOLDER / f"{name}.json").write_text(text, encoding="utf-8")
    (FOLDER / f"{name}.transcript.json").write_bytes(transcript.to_json())


def main() -> None:
    """Writes all of them."""
    from worker.test_kept_sessions import described, rollout

    for name in NAMES:
        kept = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
        written(name, kept, [rollout(data) for data in kept["rollouts"]], described)


if __name__ == "__main__":
    main()
