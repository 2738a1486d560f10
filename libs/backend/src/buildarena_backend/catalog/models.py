"""The model registry: models for submissions, and the endpoints of their providers.

An operator adds models and providers with a YAML file of the same layout (see models.yaml);
a submission can only name them, never set where requests are sent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Final

import structlog
import yaml
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError, field_validator

from buildarena_backend.errors import StartupError

log = structlog.get_logger(__name__)

OWN_FIELDS: Final = {"messages", "model", "seed", "stream", "tools", "tool_choice"}
"""Fields of a request's body that no entry may replace."""
BUILTIN_PROTOCOL: Final = "builtin"
"""Protocol of models that play inside the worker."""


class Price(BaseModel):
    """US dollars per million tokens."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    input: Annotated[float, Field(ge=0)]
    output: Annotated[float, Field(ge=0)]
    cached: Annotated[float | None, Field(ge=0)] = None
    """Default: as input."""
    source: str = ""
    """Source of the figures."""


class ProviderEntry(BaseModel):
    """Endpoint and settings of a provider."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    protocol: Annotated[
        str, Field(pattern=r"^[a-z0-9-]+$", validation_alias=AliasChoices("protocol", "wire"))
    ]
    """Protocol: openai, anthropic, google, or a worker's own."""
    base_url: Annotated[str | None, Field(pattern=r"^https?://[^/\s]")] = None
    key: str | None = None
    """Environment variable of the API key."""
    timeout_s: Annotated[float, Field(gt=0, le=7200)] = 600.0
    """Limit of one attempt."""
    concurrency: Annotated[int | None, Field(ge=1, le=2048)] = None
    """Requests open at once, over all workers."""
    headers: Annotated[
        dict[Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{1,100}$")], str],
        Field(description="Sent with every request, in addition to those of the protocol"),
    ] = Field(default={})


class ModelEntry(BaseModel):
    """A model that jobs can name."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    name: Annotated[str, Field(pattern=r"^[a-z0-9_.-]+/[A-Za-z0-9_.:-]+$")]
    provider: str
    model: str
    """The provider's own name of the snapshot."""
    baseline: bool = False
    sampling: bool = True
    """Takes temperature and top_p, which OpenAI's reasoning models refuse."""
    max_tokens: Annotated[int | None, Field(gt=0)] = None
    """Tokens of a reply, where the job's decoding has no limit."""
    extra_body: Annotated[
        dict[str, Any],
        Field(description="Further fields of a request's body, as endpoints of vLLM take them"),
    ] = Field(default={})
    price: Price | None = None

    @field_validator("extra_body")
    @classmethod
    def _adds_only(cls, fields: dict[str, Any]) -> dict[str, Any]:
        reserved = sorted(OWN_FIELDS & fields.keys())
        if reserved:
            raise ValueError(f"{', '.join(reserved)}: the session writes that itself")
        return fields


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    models: list[ModelEntry] = []
    providers: dict[str, ProviderEntry] = {}


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRegistry:
    """All models and providers by name."""

    models: Mapping[str, ModelEntry]
    providers: Mapping[str, ProviderEntry]

    def is_baseline(self, name: str) -> bool:
        """Check if a model serves for comparison only."""
        return name in self.models and self.models[name].baseline

    def provider_of(self, entry: ModelEntry) -> ProviderEntry:
        """Return the provider that serves a model."""
        return self.providers[entry.provider]


def load_registry(extra: Path | None = None) -> ModelRegistry:
    """Return the built-in registry, with an operator's file added to it or replacing entries.

    Raises:
        StartupError: The file can't be used; the message names the offending entry.
    """
    builtin = resources.files(__package__).joinpath("models.yaml").read_text()
    files = [_parse(builtin, "models.yaml")]
    if extra is not None:
        try:
            files.append(_parse(extra.read_text(), str(extra)))
        except OSError as error:
            raise StartupError(f"models file {extra}: {error.strerror}") from error
    models: dict[str, ModelEntry] = {}
    providers: dict[str, ProviderEntry] = {}
    for file in files:
        providers |= file.providers
        models |= {entry.name: entry for entry in file.models}
    for entry in models.values():
        if entry.provider not in providers:
            raise StartupError(
                f"model {entry.name!r} names the provider {entry.provider!r}; "
                f"known are {', '.join(sorted(providers))}"
            )
        if entry.extra_body and providers[entry.provider].protocol == "google":
            raise StartupError(f"model {entry.name!r}: extra_body can't be sent to Google")
    return ModelRegistry(models=models, providers=providers)


class WatchedRegistry(ModelRegistry):
    """A registry that reads an operator's file again whenever it has changed.

    A file that becomes unusable changes nothing, and is logged once.

    Args:
        extra: The operator's file; None for the built-in entries alone.

    Raises:
        StartupError: The file can't be used when the process starts.
    """

    def __init__(self, extra: Path | None = None) -> None:
        registry, stamp = load_registry(extra), _stamp_of(extra)

        def fresh() -> ModelRegistry:
            nonlocal registry, stamp
            now = _stamp_of(extra)
            if now != stamp:
                stamp = now
                try:
                    registry = load_registry(extra)
                except StartupError as error:
                    log.warning("models_file_unusable", detail=str(error))
            return registry

        object.__setattr__(self, "fresh", fresh)

    fresh: Callable[[], ModelRegistry]

    @property
    def models(self) -> Mapping[str, ModelEntry]:
        """All models by name, as the file has them now."""
        return self.fresh().models

    @property
    def providers(self) -> Mapping[str, ProviderEntry]:
        """All providers by name, as the file has them now."""
        return self.fresh().providers


def _stamp_of(file: Path | None) -> tuple[int, int] | None:
    """Return a file's modification time and size; None if it does not exist."""
    try:
        status = None if file is None else file.stat()
    except OSError:
        return None
    return None if status is None else (status.st_mtime_ns, status.st_size)


def _parse(text: str, name: str) -> _File:
    try:
        raw: Any = yaml.safe_load(text)
        return _File.model_validate(raw if raw is not None else {})
    except yaml.YAMLError as error:
        raise StartupError(f"models file {name} is not valid YAML: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise StartupError(f"models file {name}: {where}: {first['msg']}") from error
