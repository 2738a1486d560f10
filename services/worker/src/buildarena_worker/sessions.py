"""Sessions of jobs, with the task, prompts, workflow and rounds that their jobs state."""

from __future__ import annotations

from dataclasses import dataclass

from buildarena_backend.catalog.prompt_packs import PromptPack, PromptPacks
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.catalog.tracks import has_data_sheets, worlds_of
from buildarena_backend.errors import PermanentError, StartupError
from buildarena_backend.jobs.job import Job
from buildarena_backend.trials.scoring import task_of
from buildarena_benchmark.environment.briefing import describe_worlds
from buildarena_worker.session.host import SessionHost
from buildarena_worker.session.results import SessionResult
from buildarena_worker.session.session import OnTurn, Session
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.rounds import run_session


@dataclass(frozen=True, slots=True, kw_only=True)
class Sessions:
    """Factory and runner of jobs' sessions."""

    tasks: TaskCatalog
    packs: PromptPacks
    workflows: Workflows

    def begin(self, job: Job, host: SessionHost, on_turn: OnTurn | None = None) -> Session:
        """Create a job's session.

        Raises:
            PermanentError: Its task or prompts have changed, or are not on this worker.
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
            additions=[describe_worlds(worlds)] if worlds else [],
        )

    def run(self, job: Job, session: Session) -> SessionResult:
        """Run a session until it ends or must wait for a simulation.

        Raises:
            PermanentError: The job's workflow is not on this worker.
        """
        config = job.track_config
        return run_session(
            session,
            self.workflows.find(str(config["workflow"])),
            rounds=int(config["rounds"]),
            analyst=bool(config["analyst"]),
            one_shot=bool(config["one_shot"]),
        )


def _pack_of(job: Job, packs: PromptPacks) -> PromptPack:
    """Return the job's prompt pack, if it is unchanged since the job was submitted."""
    name = str(job.track_config["prompts"])
    try:
        pack = packs.load(name)
    except StartupError as error:
        raise PermanentError(str(error), reason="no_prompts") from error
    if pack.digest != job.track_config["prompts_digest"]:
        raise PermanentError(
            f"prompt pack {pack.name!r} has changed since the job was submitted: submit it again "
            "to run it on the new track",
            reason="prompts_changed",
        )
    return pack
