"""Availability of providers' keys, compared with the registry of models."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.secret_files import SUFFIX, SecretFileError, read_secret

LOOKS_LIKE_A_KEY: Final = re.compile(rf"^\w+_API_KEY(?:{SUFFIX})?$")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyReport:
    """Report on providers' keys.

    Attributes:
        there: Variables of keys that can be read.
        without: Why the models of a provider can't be reached, by the models' names.
        strangers: Variables that look like keys and that no provider names.
    """

    there: tuple[str, ...]
    without: Mapping[str, str]
    strangers: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the report for people, a line for each fault."""
        found = [f"{variable}: there" for variable in self.there]
        found += [f"{model}: {reason}" for model, reason in self.without.items()]
        return found + [f"{each}: no provider's key; see models.yaml" for each in self.strangers]


def key_report(registry: ModelRegistry, environment: Mapping[str, str]) -> KeyReport:
    """Look for the key of each provider that has models, and for keys that nobody would read."""
    there: set[str] = set()
    without: dict[str, str] = {}
    for model in registry.models.values():
        variable = registry.provider_of(model).key
        if variable is None:
            continue
        try:
            if read_secret(variable, environment) is None:
                without[model.name] = f"neither {variable} nor {variable}{SUFFIX} is set"
            else:
                there.add(variable)
        except SecretFileError as error:
            without[model.name] = str(error)
    known = {provider.key for provider in registry.providers.values()}
    strangers = (
        name
        for name, value in environment.items()
        if value and LOOKS_LIKE_A_KEY.match(name) and name.removesuffix(SUFFIX) not in known
    )
    return KeyReport(
        there=tuple(sorted(there)), without=without, strangers=tuple(sorted(strangers))
    )
