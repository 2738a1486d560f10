"""Settings of all processes, read from ``BUILDARENA_*`` once in main and passed down."""

from __future__ import annotations

from ipaddress import ip_network
from pathlib import Path
from typing import Annotated

from pydantic import Field, SecretStr, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

DEFAULT_PORT = 8321
VERSION = r"^[A-Za-z0-9._-]{0,40}$"


class Settings(BaseSettings):
    """What an operator can set. Each field is the environment variable ``BUILDARENA_<FIELD>``."""

    model_config = SettingsConfigDict(env_prefix="BUILDARENA_", extra="ignore")

    data: Annotated[Path, Field(description="Folder of databases, artifacts and logs")] = Path(
        ".buildarena"
    )
    database_url: Annotated[
        str | None, Field(description="Postgres to use instead of the embedded one")
    ] = None
    broker_url: Annotated[
        str | None, Field(description="Redis or Valkey to use instead of the embedded one")
    ] = None
    artifacts_url: Annotated[
        str | None, Field(description="Folder or bucket URL of artifacts; default DATA/artifacts")
    ] = None
    host: Annotated[str, Field(description="Address the API binds to")] = "127.0.0.1"
    port: Annotated[int, Field(description="Port of the API", ge=0, le=65535)] = DEFAULT_PORT
    require_keys: Annotated[bool, Field(description="Whether requests need an API key")] = False
    admin_key: Annotated[
        SecretStr | None,
        Field(description="Secret of the operator's own key, which makes others", min_length=16),
    ] = None
    rate_limit: Annotated[
        str, Field(description="Requests a caller may send, for example 600/minute")
    ] = "6000/minute"
    trusted_proxies: Annotated[
        str,
        Field(
            description="Addresses or networks of proxies whose X-Forwarded-For counts, "
            "separated by commas; none by default"
        ),
    ] = ""
    models_file: Annotated[
        Path | None, Field(description="YAML of further models, added to the built-in registry")
    ] = None
    prompt_packs: Annotated[
        Path | None, Field(description="Folder of further prompt packs, one folder each")
    ] = None
    workflows: Annotated[
        dict[str, str],
        Field(description='Further workflows as JSON, {"name": "path/to/file.py:Class"}'),
    ] = {}
    lease_s: Annotated[
        float, Field(description="Seconds that a lease is valid without a heartbeat", gt=1)
    ] = 10.0
    max_faults: Annotated[
        int, Field(description="Faults without progress before a job is given up", ge=1)
    ] = 8
    sessions_per_worker: Annotated[
        int,
        Field(
            description="Construction sessions of one API key that one worker runs at once", ge=1
        ),
    ] = 32
    simulations_per_worker: Annotated[
        int, Field(description="Simulations one worker runs at once", ge=1)
    ] = 2
    max_sweep_jobs: Annotated[int, Field(description="Largest sweep accepted", ge=1)] = 100_000
    besiege_game: Annotated[
        str,
        Field(
            description="Version of the game Besiege that workers play, for example 1.75-23370; "
            "jobs for the game are taken once this and BESIEGE_MOD are set",
            pattern=VERSION,
        ),
    ] = ""
    besiege_mod: Annotated[
        str, Field(description="Version of the game's Lua Scripting Mod", pattern=VERSION)
    ] = ""
    otlp_endpoint: Annotated[
        str | None, Field(description="OTLP/HTTP collector of traces; none are made without")
    ] = None
    log_level: Annotated[str, Field(description="debug, info, warning or error")] = "info"

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

    @property
    def artifacts_location(self) -> str:
        """Where artifacts are kept."""
        return self.artifacts_url or str(self.data.absolute() / "artifacts")

    @property
    def besiege_version(self) -> str | None:
        """The game and mod that workers play, as tracks name them; None without a game."""
        if not (self.besiege_game and self.besiege_mod):
            return None
        return f"{self.besiege_game}-{self.besiege_mod}"

    def required_database_url(self) -> str:
        """The database's URL.

        Raises:
            ValueError: It was not set.
        """
        if self.database_url is None:
            raise ValueError(
                "BUILDARENA_DATABASE_URL is not set: start this process through `buildarena up`, "
                "or set it to postgresql://user:password@host:port/name"
            )
        return self.database_url

    def required_broker_url(self) -> str:
        """The broker's URL.

        Raises:
            ValueError: It was not set.
        """
        if self.broker_url is None:
            raise ValueError(
                "BUILDARENA_BROKER_URL is not set: start this process through `buildarena up`, "
                "or set it to redis://:password@host:port/0"
            )
        return self.broker_url
