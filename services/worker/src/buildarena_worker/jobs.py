"""What a job says about its session: its prompts, and what it does besides one round."""

from __future__ import annotations

from buildarena_backend.catalog.prompt_packs import PromptPack, PromptPacks
from buildarena_backend.errors import PermanentError, StartupError
from buildarena_backend.jobs.job import Job
from buildarena_worker.workflow.rounds import Loop


def pack_of(job: Job, packs: PromptPacks) -> PromptPack:
    """The job's prompt pack, as long as it is still the one that the job was submitted with.

    Raises:
        PermanentError: It has changed, or it is not on this worker.
    """
    name, wanted = str(job.track_config["prompts"]), job.track_config["prompts_digest"]
    try:
        pack = packs.load(name)
    except StartupError as error:
        raise PermanentError(str(error), reason="no_prompts") from error
    if pack.digest != wanted:
        raise PermanentError(
            f"prompt pack {pack.name!r} has changed since the job was submitted: submit it again "
            "to run it on the new track",
            reason="prompts_changed",
        )
    return pack


def loop_of(job: Job) -> Loop:
    """What the job's track says about rounds, analyst and example."""
    config = job.track_config
    return Loop(
        rounds=int(config["rounds"]),
        analyst=bool(config["analyst"]),
        one_shot=bool(config["one_shot"]),
    )
