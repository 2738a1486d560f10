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
        available: Variables of keys that can be read.
        without: Reasons why models can't be reached, by the models' names.
        unused: Variables that look like keys but belong to no provider.
    """

    available: tuple[str, ...]
    without: Mapping[str, str]
    unused: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the report for people, a line for each fault."""
        lines = [f"{variable}: available" for variable in self.available]
        lines += [f"{model}: {reason}" for model, reason in self.without.items()]
        return lines + [f"{each}: belongs to no provider; see models.yaml" for each in self.unused]


def key_report(registry: ModelRegistry, environment: Mapping[str, str]) -> KeyReport:
    """Find the key of each provider that has models, and keys that belong to no provider."""
    available: set[str] = set()
    without: dict[str, str] = {}
    for model in registry.models.values():
        variable = registry.provider_of(model).key
        if variable is None:
            continue
        try:
            if read_secret(variable, environment) is None:
                without[model.name] = f"neither {variable} nor {variable}{SUFFIX} is set"
            else:
                available.add(variable)
        except SecretFileError as error:
            without[model.name] = str(error)
    valid = {provider.key for provider in registry.providers.values()}
    unused = (
        name
        for name, value in environment.items()
        if value and LOOKS_LIKE_A_KEY.match(name) and name.removesuffix(SUFFIX) not in valid
    )
    return KeyReport(
        available=tuple(sorted(available)), without=without, unused=tuple(sorted(unused))
    )
