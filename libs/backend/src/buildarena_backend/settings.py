"""Settings of all processes, read from ``BUILDARENA_*`` once in main and passed down."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, Field, PrivateAttr, SecretStr, ValidationError, field_validator
from pydantic.fields import FieldInfo
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    SettingsError,
)

from buildarena_backend.errors import StartupError
from buildarena_backend.secret_files import read_secret
from buildarena_simulation.constants import MAX_WORLDS

PREFIX: Final = "BUILDARENA_"
DEFAULT_PORT = 8321
VERSION = r"^[A-Za-z0-9._-]{0,40}$"
SIMULATOR_NAME: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")


def _simulator_name(name: str) -> str:
    if not SIMULATOR_NAME.fullmatch(name):
        raise ValueError(f"{name!r} names no simulator: up to 40 of a-z, 0-9, - and _")
    return name


SimulatorName = Annotated[str, AfterValidator(_simulator_name)]
SimulatorVersion = Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{1,40}$")]
BASE_PATH: Final = re.compile(r"(?:/(?!\.{1,2}(?:/|$))[A-Za-z0-9._~-]+)+")
PAGES: Final = ("sweeps", "jobs", "tasks", "models", "compare", "method", "build")
"""First parts of the addresses of the dashboard's pages."""
OWN_PATHS: Final = frozenset(
    (
        *("v1", "docs", "openapi.json", "static-offline-docs"),
        *("assets", *PAGES, "favicon.svg", "scheme.js", "index.html"),
    )
)
"""First parts of the API's and the dashboard's own paths; none can be a base path's."""
SECRETS: Final = (
    "database_url",
    "database_direct_url",
    "broker_url",
    "artifacts_url",
    "admin_key",
    "previous_admin_key",
    "metrics_key",
)
"""Settings that hold secrets: ``BUILDARENA_<FIELD>_FILE`` can name a file for each of them."""
ARTIFACT_CREDENTIALS: Final = ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN")
"""Credentials of an S3 store by their usual names; each also as a file."""


class SecretFiles(PydanticBaseSettingsSource):
    """Settings whose values are in files."""

    def get_field_value(self, field: FieldInfo, field_name: str) -> tuple[Any, str, bool]:
        """Return the value of a field; None when it is not a secret, or not in a file."""
        del field
        if field_name not in SECRETS:
            return None, field_name, False
        return read_secret(PREFIX + field_name.upper(), os.environ), field_name, False

    def __call__(self) -> dict[str, Any]:
        """Return all values that are set."""
        values = {name: self.get_field_value(field, name)[0] for name, field in self._fields}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def _fields(self) -> list[tuple[str, FieldInfo]]:
        return list(self.settings_cls.model_fields.items())


def _artifact_credentials() -> Mapping[str, SecretStr]:
    secrets = {name: read_secret(name, os.environ) for name in ARTIFACT_CREDENTIALS}
    return {name: SecretStr(value) for name, value in secrets.items() if value is not None}


class Settings(BaseSettings):
    """Settings of an operator. Each field is the environment variable ``BUILDARENA_<FIELD>``.

    Secrets can be in files (see `SECRETS`).
    """

    # Compose files spell a variable that is left out as an empty one.
    model_config = SettingsConfigDict(env_prefix=PREFIX, extra="ignore", env_ignore_empty=True)

    _artifact_credentials: Mapping[str, SecretStr] = PrivateAttr(
        default_factory=_artifact_credentials
    )

    data: Path = Path(".buildarena")
    """Folder of databases, artifacts and logs."""
    database_url: str | None = None
    """Postgres to use instead of the embedded one."""
    database_direct_url: str | None = None
    """The same Postgres past a pooler such as PgBouncer, for migrations, backups and collections;
    default BUILDARENA_DATABASE_URL."""
    database_connections: Annotated[int | None, Field(ge=1, le=100)] = None
    """Connections to Postgres that a process keeps for its work; it may open as many again for a
    moment, and an API has 4 more."""
    broker_url: str | None = None
    """Redis or Valkey to use instead of the embedded one."""
    artifacts_url: str | None = None
    """Folder or bucket URL of artifacts; default DATA/artifacts."""
    host: str = "127.0.0.1"
    """Address the API binds to."""
    port: Annotated[int, Field(ge=0, le=65535)] = DEFAULT_PORT
    """Port of the API."""
    require_keys: bool = False
    """Whether requests need an API key."""
    admin_key: Annotated[SecretStr | None, Field(min_length=16)] = None
    """Secret of the operator's own key, which makes others."""
    previous_admin_key: Annotated[SecretStr | None, Field(min_length=16)] = None
    """The operator's key before this one, while both are valid."""
    metrics_key: Annotated[SecretStr | None, Field(min_length=16)] = None
    """Secret that opens the metrics, and nothing else."""
    worlds: Annotated[int, Field(ge=0, le=MAX_WORLDS)] = 4
    """Default number of varied worlds in which finished machines are scored."""
    rate_limit: str = "6000/minute"
    """Requests a caller may send, for example 600/minute."""
    trusted_proxies: str = ""
    """Addresses or networks of proxies whose X-Forwarded-For counts, separated by commas; none by
    default."""
    base_path: str = ""
    """Path below which a proxy shows the API and the dashboard, for example /arena; empty at a
    host's root."""
    models_file: Path | None = None
    """YAML of further models, added to the built-in registry."""
    prompt_packs: Path | None = None
    """Folder of further prompt packs, one folder each."""
    workflows: dict[str, str] = {}
    """Further workflows as JSON, {"name": "path/to/file.py:Class"}."""
    lease_s: Annotated[float, Field(gt=1)] = 10.0
    """Seconds that a lease is valid without a heartbeat."""
    stop_grace_s: Annotated[float, Field(gt=0)] = 60.0
    """Seconds that a worker or runner has to stop when it is asked to: in two thirds of them open
    requests and trials finish, then the rest is handed back."""
    max_faults: Annotated[int, Field(ge=1)] = 8
    """Faults without progress before a job is given up."""
    sessions_per_worker: Annotated[int, Field(ge=1)] = 32
    """Construction sessions of one API key that one worker runs at once."""
    simulations_per_worker: Annotated[int, Field(ge=1)] = 2
    """Simulations one worker runs at once."""
    max_sweep_jobs: Annotated[int, Field(ge=1)] = 100_000
    """Largest sweep accepted."""
    besiege_game: Annotated[str, Field(pattern=VERSION)] = ""
    """Version of the game Besiege that workers play, for example 1.75-23370; jobs for the game are
    taken once this and BESIEGE_MOD are set."""
    besiege_mod: Annotated[str, Field(pattern=VERSION)] = ""
    """Version of the game's Lua Scripting Mod."""
    extra_simulators: dict[SimulatorName, SimulatorVersion] = {}
    """Simulators of other distributions, each with its version, that jobs and keys of runners may
    name before a worker has announced them; JSON: {"drake": "1"}."""
    verification_rate: Annotated[float, Field(ge=0, le=1)] = 1.0
    """Share of the trials by runners that a worker next to the database repeats before their jobs
    count, on engines that repeat exactly; 0 to 1."""
    alive_file: Path | None = None
    """File that a worker touches at each heartbeat, for its container's health check."""
    otlp_endpoint: str | None = None
    """OTLP/HTTP collector of traces; none are made without."""
    log_level: str = "info"
    """debug, info, warning or error."""

    @property
    def finishing_s(self) -> float:
        """Seconds in which what is under way may finish when a process is asked to stop."""
        return self.stop_grace_s * 2 / 3

    @field_validator("trusted_proxies")
    @classmethod
    def _only_addresses(cls, value: str) -> str:
        named = [part.strip() for part in value.split(",") if part.strip()]
        for part in named:
            try:
                ip_network(part)
            except ValueError as error:
                raise ValueError(
                    f"{part!r} is neither an address nor a network such as 10.0.0.0/8"
                ) from error
        return ",".join(named)

    @field_validator("base_path")
    @classmethod
    def _a_path_of_its_own(cls, value: str) -> str:
        path = value.rstrip("/")
        if path and not BASE_PATH.fullmatch(path):
            raise ValueError(
                "it must begin with / and consist of letters, digits and any of . _ ~ - /, "
                "for example /arena or /tools/arena"
            )
        if path.split("/")[1:2] and path.split("/")[1] in OWN_PATHS:
            raise ValueError(
                f"the service has its own paths below /{path.split('/')[1]}: "
                f"choose any but {', '.join(sorted(OWN_PATHS))}"
            )
        return path

    @classmethod
    def settings_customise_sources(  # noqa: D102 - pydantic's
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        del dotenv_settings, file_secret_settings
        return init_settings, env_settings, SecretFiles(settings_cls)

    @property
    def admin_keys(self) -> tuple[str, ...]:
        """The secrets that make a caller the operator: two while one is being replaced."""
        secrets = (self.admin_key, self.previous_admin_key)
        return tuple(key.get_secret_value() for key in secrets if key is not None)

    @property
    def artifact_options(self) -> dict[str, str]:
        """Options of the artifact store besides its location: an S3 store's credentials."""
        if not self.artifacts_location.startswith(("s3://", "s3a://")):
            return {}
        return {
            name: value.get_secret_value() for name, value in self._artifact_credentials.items()
        }

    @property
    def artifact_folder(self) -> Path:
        """The folder whose disk is monitored: that of artifacts, or the data folder without one."""
        location = self.artifacts_location
        return self.data.absolute() if "://" in location else Path(location).absolute()

    @property
    def artifacts_location(self) -> str:
        """Location of the artifact store."""
        return self.artifacts_url or str(self.data.absolute() / "artifacts")

    @property
    def besiege_version(self) -> str | None:
        """Versions of game and mod, as tracks name them; None without a game."""
        if not (self.besiege_game and self.besiege_mod):
            return None
        return f"{self.besiege_game}-{self.besiege_mod}"

    def required_database_url(self) -> str:
        """Return the database's URL.

        Raises:
            ValueError: It was not set.
        """
        form = "postgresql://user:password@host:port/name"
        return _require(self.database_url, "DATABASE_URL", form)

    def direct_database_url(self) -> str:
        """Return the database's URL past any pooler, for long use of one server.

        Raises:
            ValueError: None was set.
        """
        return self.database_direct_url or self.required_database_url()

    def required_broker_url(self) -> str:
        """Return the broker's URL.

        Raises:
            ValueError: It was not set.
        """
        return _require(self.broker_url, "BROKER_URL", "redis://:password@host:port/0")


def _require(value: str | None, name: str, form: str) -> str:
    if value is None:
        raise ValueError(
            f"{PREFIX}{name} is not set: start this process through `buildarena up`, or set it to "
            f"{form}"
        )
    return value


def load_settings(**overrides: Any) -> Settings:
    """Return the settings of this process' environment.

    Args:
        overrides: Settings that go before the environment's.

    Raises:
        StartupError: One is wrong; the message names its variable, and shows no secret.
    """
    try:
        return Settings(**overrides)
    except ValidationError as error:
        raise StartupError(problem_of(error)) from error
    except (SettingsError, ValueError) as error:
        raise StartupError(str(error)) from error


def problem_of(error: ValidationError) -> str:
    """Return the first invalid setting's problem in one line without secrets."""
    first = error.errors()[0]
    name = str(first["loc"][0]) if first["loc"] else ""
    got = "" if name in SECRETS else f", got {first['input']!r}"
    return f"{PREFIX}{name.upper()}: {first['msg']}{got}"
