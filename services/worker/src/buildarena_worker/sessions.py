"""Sessions as their jobs say: task, prompts, workflow, and what they do besides one round."""

from __future__ import annotations

from dataclasses import dataclass

from buildarena_backend.catalog.prompt_packs import PromptPack, PromptPacks
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.catalog.tracks import has_data_sheets, worlds_of
from buildarena_backend.errors import PermanentError, StartupError
from buildarena_backend.jobs.job import Job
from buildarena_backend.trials.scoring import task_of
from buildarena_benchmark.environment.briefing import worlds_told
from buildarena_worker.session.host import SessionHost
from buildarena_worker.session.results import SessionResult
from buildarena_worker.session.session import OnTurn, Session
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.rounds import Loop, run_session


@dataclass(frozen=True, slots=True, kw_only=True)
class Sessions:
    """Makes and runs the sessions of jobs.

    Attributes:
        workflows: The ways to build.
    """

    tasks: TaskCatalog
    packs: PromptPacks
    workflows: Workflows

    def begin(self, job: Job, host: SessionHost, on_turn: OnTurn | None = None) -> Session:
        """Return a job's session before its first step.

        Raises:
            PermanentError: Its task or its prompts have changed, or are not on this worker.
        """
        worlds = worlds_of(job.track_config)
        return Session(
            task=task_of(job, self.tasks),
            seed=job.seed,
            model_config=job.model_config,
            pack=_pack_of(job, self.packs),
            host=host,
            on_turn=on_turn,
            data_sheets=has_data_sheets(job.track_config),
            additions=[worlds_told(worlds)] if worlds else [],
        )

    def run(self, job: Job, session: Session) -> SessionResult:
        """Run a session as far as it gets.

        Raises:
            PermanentError: The job's workflow is not on this worker.
        """
        config = job.track_config
        loop = Loop(
            rounds=int(config["rounds"]),
            analyst=bool(config["analyst"]),
            one_shot=bool(config["one_shot"]),
        )
        return run_session(session, self.workflows.find(str(config["workflow"])), loop)


def _pack_of(job: Job, packs: PromptPacks) -> PromptPack:
    """The job's prompt pack, as long as it is still the one that the job was submitted with."""
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
