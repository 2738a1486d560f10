"""The registry of tests: with it, what built-in models do can be paid for."""

from typing import Final

from buildarena_backend.catalog.models import ModelRegistry, ProviderEntry, load_registry

_KNOWN: Final = load_registry()
REGISTRY: Final = ModelRegistry(
    models={
        **_KNOWN.models,
        **{
            f"paid/{name}": _KNOWN.models[f"builtin/{name}"].model_copy(
                update={"name": f"paid/{name}", "provider": "paid", "baseline": False}
            )
            for name in ("expert", "idle")
        },
    },
    providers={**_KNOWN.providers, "paid": ProviderEntry(protocol="builtin")},
)
"""With `paid/expert` and `paid/idle`: the built-in models, whose requests count in budgets."""
