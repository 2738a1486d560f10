"""Puts the construct worker's parts together from a process' connections."""

from __future__ import annotations

from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.catalog.prompt_packs import PromptPacks
from buildarena_backend.process.context import Context
from buildarena_worker.construct import ConstructHandler
from buildarena_worker.providers.clients import ModelClients
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.sessions import Sessions
from buildarena_worker.verify.runner import VerificationRunner
from buildarena_worker.verify.verifier import Verifier
from buildarena_worker.workflow import Workflows


def construct_handler(context: Context, registry: ModelRegistry) -> ConstructHandler:
    """What does the construct stage.

    Args:
        context: The process' connections.
        registry: Models and providers.
    """
    return ConstructHandler(
        store=context.store,
        artifacts=context.artifacts,
        queues=context.queues,
        registry=registry,
        clients=ModelClients(registry, context.settings.broker_url),
        sessions=_sessions(context),
        gate=ConcurrencyGate(),
    )


def verifier(context: Context) -> Verifier:
    """What verifies finished jobs."""
    return Verifier(store=context.store, artifacts=context.artifacts, sessions=_sessions(context))


def verification_runner(context: Context) -> VerificationRunner:
    """What does the verifications that messages speak of."""
    return VerificationRunner(context.store.verifications, verifier(context))


def _sessions(context: Context) -> Sessions:
    return Sessions(
        tasks=context.tasks,
        packs=PromptPacks(context.settings.prompt_packs),
        workflows=Workflows(context.settings.workflows),
    )
