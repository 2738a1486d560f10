"""The registry of tests: with it, what built-in models do can be paid for."""

from typing import Final

from buildarena_backend.catalog.models import ModelRegistry, ProviderEntry, load_registry

_KNOWN: Final = load_registry()
_NAMES: Final = {f"paid/{name}": _KNOWN.models[f"builtin/{name}"] for name in ("expert", "idle")}
_PAID: Final = {"provider": "paid", "baseline": False}
_MADE: Final = {n: one.model_copy(update={"name": n, **_PAID}) for n, one in _NAMES.items()}
_PROVIDERS: Final = {**_KNOWN.providers, "paid": ProviderEntry(protocol="builtin")}
REGISTRY: Final = ModelRegistry(models={**_KNOWN.models, **_MADE}, providers=_PROVIDERS)
"""With `paid/expert` and `paid/idle`: the built-in models, whose requests count in budgets."""
