"""Sessions of jobs, with the task, prompts, workflow and rounds that their jobs state."""

from buildarena_backend.catalog.prompt_packs import PromptPack, PromptPacks
from buildarena_backend.catalog.tracks import has_data_sheets, worlds_of
from buildarena_backend.errors import PermanentError, StartupError
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.trials.scoring import task_of
from buildarena_benchmark.environment.briefing import describe_worlds
from buildarena_worker.session.host import JournalHost
from buildarena_worker.session.results import SessionResult
from buildarena_worker.session.session import OnTurn, Session
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.rounds import run_session


class Sessions:
    """Factory and runner of jobs' sessions."""

    def __init__(self, context: Context) -> None:
        self.tasks = context.tasks
        self._packs = PromptPacks(context.settings.prompt_packs)
        self._workflows = Workflows(context.settings.workflows)

    def run(
        self, job: Job, host: JournalHost, on_turn: OnTurn | None = None
    ) -> tuple[Session, SessionResult]:
        """Run a job's session until it ends or must wait for a simulation.

        Raises:
            PermanentError: Its task or prompts have changed, or they or its workflow are not on
                this worker.
        """
        config = job.track_config
        worlds = worlds_of(config)
        session = Session(
            task=task_of(job, self.tasks),
            seed=job.seed,
            model_config=job.model_config,
            pack=_pack_of(job, self._packs),
            host=host,
            on_turn=on_turn,
            data_sheets=has_data_sheets(config),
            additions=[describe_worlds(worlds)] if worlds else [],
        )
        return session, run_session(
            session,
            self._workflows.find(str(config["workflow"])),
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
