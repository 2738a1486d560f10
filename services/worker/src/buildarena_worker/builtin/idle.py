"""The idle model: it ends whatever it is asked to do. Its scores are the floor."""

from __future__ import annotations

from buildarena_worker.session.messages import Completion, Request


def reply(request: Request) -> Completion:
    """Always the word that ends a phase."""
    del request
    return Completion(text="TERMINATE")
