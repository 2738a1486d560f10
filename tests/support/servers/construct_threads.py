"""A construct worker against stand-ins for providers: its threads here, or a process of its own."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from support.programs import variables_of
from support.providers.stand_in import ProviderStandIn
from support.servers.stacks import wait_until

from buildarena_backend.catalog.models import ModelRegistry, load_registry
from buildarena_backend.catalog.specs import JobSpec
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.active_lease import LeaseKeeper
from buildarena_backend.process.context import Context
from buildarena_backend.process.job_runner import JobRunner, OwnerSlots
from buildarena_backend.states import CONSTRUCT_QUEUE
from buildarena_backend.submission.submission import Submissions
from buildarena_worker.providers.provider import ProviderClient
from buildarena_worker.wiring import construct_handler

PRICE = "{input: 2.0, output: 8.0, cached: 0.5}"


def models_file(folder: Path, standins: Mapping[str, ProviderStandIn]) -> Path:
    """A registry with a model ``NAME/expert`` for each stand-in."""
    file = folder / "models.yaml"
    line = "  {0}: {{protocol: openai, base_url: '{1}/v1'}}\n"
    providers = [line.format(name, one.url) for name, one in standins.items()]
    models = [
        f"  - {{name: {n}/expert, provider: {n}, model: expert, price: {PRICE}}}\n"
        for n in standins
    ]
    file.write_text(f"providers:\n{''.join(providers)}models:\n{''.join(models)}")
    return file


@dataclass
class Crew:
    """Threads that do construct stages, and how to give them work."""

    context: Context
    registry: ModelRegistry
    runner: JobRunner
    keeper: LeaseKeeper
    slots: OwnerSlots

    def submit(self, provider: str, *, owner: str | None = None, **payload: object) -> str:
        """Submits a job; returns its id."""
        spec = {"task": "lift-1", "model": f"{provider}/expert", "simulator": "mujoco", **payload}
        submissions = Submissions(self.context, self.registry)
        return submissions.submit_job(JobSpec.model_validate(spec), owner=owner)[0].id

    def job(self, job_id: str) -> Job:
        """The job as it is now."""
        return self.context.store.jobs.get(job_id)

    def ended(self, job_id: str, within_s: float = 20) -> Job:
        """The job, once it has ended."""
        wait_until(lambda: self.job(job_id).state == "done", within_s, f"{job_id} ended")
        return self.job(job_id)

    def requests(self, job_id: str) -> list[dict[str, object]]:
        """The job's journal, in short."""
        entries = self.context.store.journal.read(job_id)
        told = [(entry.reply["finish"], entry.usage, entry.latency_s) for entry in entries]
        return [dict(zip(("finish", "usage", "latency_s"), each, strict=True)) for each in told]


@contextmanager
def crew(
    context: Context, folder: Path, slots: int = 2, **standins: ProviderStandIn
) -> Iterator[Crew]:
    """Works on construct stages until the block is left; then all requests end at once."""
    registry = load_registry(models_file(folder, standins))
    keeper = LeaseKeeper(context.store.leases, lambda: None)
    keeper.start()
    shared = OwnerSlots(slots)
    handler = construct_handler(context, registry)
    runner = JobRunner(context.store.leases, handler, keeper, "w", shared)
    over = threading.Event()

    def work() -> None:
        while not over.wait(0.05):
            runner.process_all(CONSTRUCT_QUEUE)

    threads = [threading.Thread(target=work) for _ in range(shared.total)]
    for thread in threads:
        thread.start()
    try:
        yield Crew(context, registry, runner, keeper, shared)
    finally:
        over.set()
        runner.stop()
        keeper.stop()
        for thread in threads:
            thread.join(timeout=10)
        assert not any(thread.is_alive() for thread in threads)
        for *_, client in handler.clients._clients.values():
            if isinstance(client, ProviderClient):
                client.close()


@contextmanager
def worker_process(
    context: Context, folder: Path, model: ProviderStandIn, **more: str
) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The id of a job for a stand-in's model, and a worker that has sent its first request.

    Args:
        context: Its settings name the database and the broker.
        folder: Where the registry of models is written.
        model: The stand-in.
        more: Further variables of the worker.
    """
    file, settings = models_file(folder, {"only": model}), context.settings
    spec = JobSpec(task="lift-1", model="only/expert", simulator="mujoco")
    job, _ = Submissions(context, load_registry(file)).submit_job(spec)
    environment = {**os.environ, **variables_of(settings, models_file=file), **more}
    process = subprocess.Popen([sys.executable, "-m", "buildarena_worker"], env=environment)
    try:
        wait_until(lambda: model.counts.requests, 20, "the request is sent")
        yield job.id, process
    finally:
        process.kill()
        process.wait()
