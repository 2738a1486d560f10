"""The answers of a site that are of one job: its record, transcript, replay, trials, pictures."""

from __future__ import annotations

import json
import re
from typing import Final

from buildarena_cli.client import Client, at
from buildarena_cli.site.asking import Answer, Answers, TooLargeError, ask, question

ARROW: Final = "application/vnd.apache.arrow.stream"
ROLLOUT: Final = re.compile(r"trajectory-([0-9]+)")
ENDINGS: Final = {"application/json": "json", "text/plain": "txt", "image/png": "png"}


def job_answers(client: Client, job_id: str) -> Answers:
    """Everything that pages ask about a job that has ended.

    Args:
        client: The API.
        job_id: The job.
    """
    answers: Answers = {}

    def put(
        rest: str = "", *, ending: str = "json", accept: str | None = None, **asked: object
    ) -> None:
        parts = [job_id, *filter(None, rest.split("/"))]
        try:
            content = ask(client, at("jobs", *parts), accept=accept, **asked)
        except TooLargeError:
            # Pages say of a file without an entry that it was left out.
            return
        key = question("/".join(["/v1/jobs", *parts]), asked)
        answers[key] = None if content is None else Answer(content, ending)

    put()
    detail = answers[f"/v1/jobs/{job_id}"]
    artifacts = {} if detail is None else json.loads(detail.content)["artifacts"]
    put("transcript")
    put("prompts")
    put("replay")
    for name in artifacts:
        if match := ROLLOUT.fullmatch(name):
            put("scene", number=int(match[1]))
            put("trajectory", ending="arrow", accept=ARROW, number=int(match[1]))
    if "machine" in artifacts:
        put("machine.glb", ending="glb", accept="model/gltf-binary")
        put("thumbnail.png", ending="png", accept="image/png")
    _files(client, job_id, answers)
    return answers


def _files(client: Client, job_id: str, answers: Answers) -> None:
    """The list of a job's files, and those files; trajectories are there as trials already."""
    listed = ask(client, at("jobs", job_id, "artifacts"))
    files = [] if listed is None else json.loads(listed)["data"]
    others = [file for file in files if ROLLOUT.fullmatch(file["name"]) is None]
    answers[f"/v1/jobs/{job_id}/artifacts"] = Answer(
        json.dumps({"data": others, "next_cursor": None}, separators=(",", ":")).encode()
    )
    for file in others:
        content = ask(client, at("jobs", job_id, "artifacts", file["name"]))
        key = f"/v1/jobs/{job_id}/artifacts/{file['name']}"
        ending = ENDINGS.get(file["media_type"], "bin")
        answers[key] = None if content is None else Answer(content, ending)
