"""A season of a challenge: its tracks, its files, its rules and its score, as data."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

import yaml
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator

from buildarena_geometry.modules.sets import module_set
from buildarena_store.ids import content_hash

Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]
FileName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,59}$")]
Sentence = Annotated[str, Field(min_length=1, max_length=2000)]
Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0, le=1e6)]
Coordinate = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
_MAX_BYTES: Final = 1 << 20
_WEIGHTS_SUM: Final = 1e-9


class SeasonError(ValueError):
    """There is no such season, or its file is wrong; the message says why."""


class _Form(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Track(_Form):
    """Who may have built what is handed in.

    Attributes:
        title: What people read.
        coefficient: What a score is multiplied by; None where it is not known.
        transcript: Whether the conversation with the builder must be there.
    """

    title: Sentence
    coefficient: Positive | None = None
    transcript: bool = True


class PackageFiles(_Form):
    """What the files of a flight's package are called.

    Attributes:
        raw: The machine that the history builds, as the game's file.
        history: The actions that built it.
        full_history: All that was asked for, queries and refused actions too.
        tuned: The machine that flew: keys and settings may differ from the raw one's.
        trajectory: What the tracker wrote of the flight.
    """

    raw: FileName = "machine_raw.bsg"
    history: FileName = "build_history.json"
    full_history: FileName = "build_history_full.json"
    tuned: FileName = "machine_tuned.bsg"
    trajectory: FileName = "trajectory.csv"


class TrackerRules(_Form):
    """What a sound tracker file is like.

    Attributes:
        rate_hz: Samples a second.
        rate_within: By what share the mean rate may differ.
        longest_gap_s: Between two samples, seconds.
        largest_acceleration: What no machine's thrust exceeds, units/s²: beyond it a sample is a
            jump.
        mods: Ids of the mods that a machine file may ask for.
    """

    rate_hz: Positive = 10.0
    rate_within: Share = 0.1
    longest_gap_s: Positive = 0.5
    largest_acceleration: Positive
    mods: tuple[Annotated[str, Field(max_length=100)], ...] = ()


class OrbitScore(_Form):
    """A flight in the game, around a planet; what is not known is None, and asked for.

    Attributes:
        formula: Tells it from others.
        files: What the package's files are called, but for the transcript.
        dialect: The interface that the histories are of.
        tracker: What a sound tracker file is like.
        progress: Weight of how many cycles were flown.
        speed: Weight of the mean angular speed.
        integrity: Weight of how whole the machine is at the end.
        cycles: At how many cycles the first is full.
        center: Of the planet, the game's axes, units.
        omega_ref: At which angular speed the second is full, rad/s.
        cost_penalty: Points taken for each unit of cost.
    """

    formula: Literal["orbit"]
    files: PackageFiles = PackageFiles()
    dialect: Literal["1.0", "2.0"]
    tracker: TrackerRules
    progress: Share
    speed: Share
    integrity: Share
    cycles: Positive
    center: tuple[Coordinate, Coordinate, Coordinate] | None = None
    omega_ref: Positive | None = None
    cost_penalty: Annotated[float, Field(ge=0, le=1e6)] | None = None

    @model_validator(mode="after")
    def _sums_to_one(self) -> Self:
        total = self.progress + self.speed + self.integrity
        if abs(total - 1.0) > _WEIGHTS_SUM:
            raise ValueError(f"the weights sum to {total:g}, not to 1")
        return self

    @property
    def file_names(self) -> tuple[str, ...]:
        """What a package has, but for the transcript."""
        return tuple(self.files.model_dump().values())

    @property
    def in_words(self) -> str:
        """The formula as people read it."""
        return (
            f"100 ({self.progress:g} progress + {self.speed:g} speed + {self.integrity:g} "
            f"integrity); progress is full at {self.cycles:g} cycles"
        )


class TrialsScore(_Form):
    """Trials in our own physics: a machine for each of some tasks.

    Attributes:
        formula: Tells it from others.
        tasks: For each task the indicator at which its share is full; all weigh the same.
        cost_penalty: Points taken for each unit of cost of all machines together.
    """

    formula: Literal["trials"]
    tasks: Annotated[dict[Name, Positive], Field(min_length=1, max_length=20)]
    cost_penalty: Annotated[float, Field(ge=0, le=1e6)] | None = 0.0

    @property
    def file_names(self) -> tuple[str, ...]:
        """What a package has, but for the transcript."""
        return tuple(map(machine_file, self.tasks))

    @property
    def in_words(self) -> str:
        """The formula as people read it."""
        full = ", ".join(f"{name} at {indicator:g}" for name, indicator in self.tasks.items())
        return f"100 · the mean over the tasks of indicator / full, at most 1; full are {full}"


def machine_file(task: str) -> str:
    """What the machine for a task is called in a package."""
    return f"{task}.json"


Score = Annotated[OrbitScore | TrialsScore, Field(discriminator="formula")]


class Season(_Form):
    """A season.

    Attributes:
        name: In addresses and commands.
        title: What people read.
        about: What is asked for.
        sources: Where what is stated here comes from.
        opens: When packages are taken; None for always.
        closes: Until when; None for always.
        attempts_a_day: How many packages one owner may hand in a day; None for any number.
        tracks: By name.
        transcript: What the conversation with the builder is called in a package.
        modules: What machines may be made of: a set, or modules' names.
        score: What is handed in, and how it is scored.
    """

    name: Name
    title: Sentence
    about: Sentence
    sources: tuple[Sentence, ...] = ()
    opens: AwareDatetime | None = None
    closes: AwareDatetime | None = None
    attempts_a_day: Annotated[int, Field(ge=1, le=10_000)] | None = None
    tracks: Annotated[dict[Name, Track], Field(min_length=1, max_length=20)]
    transcript: FileName = "chat_transcript.md"
    modules: Literal["basic", "workshop", "all"] | tuple[str, ...] = "all"
    score: Score

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        if self.opens and self.closes and self.closes <= self.opens:
            raise ValueError("it closes before it opens")
        names = (*self.score.file_names, self.transcript)
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"two files are called {twice}")
        known = module_set("all")
        unknown = next((name for name in self.allowed if name not in known), None)
        if unknown is not None:
            raise ValueError(f"modules: there is no module {unknown!r}")
        return self

    @property
    def allowed(self) -> frozenset[str]:
        """The names of the modules that machines may be made of."""
        chosen = module_set(self.modules) if isinstance(self.modules, str) else self.modules
        return frozenset(chosen)

    @property
    def digest(self) -> str:
        """Hash of all that it says: packages that were checked by other rules are checked again."""
        return content_hash(self.model_dump(mode="json"))

    @property
    def parameters(self) -> tuple[str, ...]:
        """The numbers of the score's formula, by name."""
        others = {"formula", "files", "dialect", "tracker", "tasks"}
        return tuple(name for name in type(self.score).model_fields if name not in others)

    @property
    def unknown(self) -> tuple[str, ...]:
        """The parameters of the score that nobody has stated: an operator gives them."""
        missing = [name for name, value in self.score.model_dump().items() if value is None]
        tracks = (name for name, track in self.tracks.items() if track.coefficient is None)
        return (*missing, *(f"coefficient.{name}" for name in tracks))

    def with_parameters(self, parameters: dict[str, Any]) -> Season:
        """The same season, some parameters of its score given.

        Args:
            parameters: By name, as in `unknown`.

        Raises:
            SeasonError: There is no such parameter, or a value makes no sense.
        """
        content = self.model_dump(mode="json")
        for name, value in parameters.items():
            kind, _, track = name.partition(".")
            if kind == "coefficient" and track in content["tracks"]:
                content["tracks"][track]["coefficient"] = value
            elif name in self.parameters:
                content["score"][name] = value
            else:
                choices = [*self.parameters, *(f"coefficient.{track}" for track in self.tracks)]
                raise SeasonError(
                    f"{name} is no parameter of {self.name}; there is {', '.join(choices)}"
                )
        return season_of(content, where=self.name)


@cache
def builtin_seasons() -> dict[str, Season]:
    """The seasons that the product knows, by name."""
    folder = resources.files(__package__).joinpath("seasons")
    files = sorted((file.name, file) for file in folder.iterdir() if file.name.endswith(".yaml"))
    seasons = [read_season(file.read_bytes(), where=name) for name, file in files]
    return {season.name: season for season in seasons}


def all_seasons(folder: Path | None) -> dict[str, Season]:
    """The built-in seasons and those of an operator's folder, which may replace them.

    Args:
        folder: With a YAML file for each; None without one.

    Raises:
        SeasonError: The folder cannot be read, or a file in it is wrong.
    """
    seasons = dict(builtin_seasons())
    if folder is None:
        return seasons
    try:
        files = sorted(each for each in folder.iterdir() if each.suffix in {".yaml", ".yml"})
        own = [read_season(each.read_bytes(), where=each.name) for each in files]
    except OSError as error:
        raise SeasonError(f"{folder}: {error.strerror}") from error
    return seasons | {season.name: season for season in own}


def season_named(name: str) -> Season:
    """A built-in season, or that of a file.

    Args:
        name: Its name, or the path of a YAML file.

    Raises:
        SeasonError: There is no such season, or its file is wrong.
    """
    if name in builtin_seasons():
        return builtin_seasons()[name]
    path = Path(name)
    if path.suffix not in {".yaml", ".yml"}:
        raise SeasonError(
            f"there is no season {name[:60]!r}; there is {', '.join(builtin_seasons())}, or the "
            "path of a .yaml file"
        )
    try:
        with path.open("rb") as file:
            return read_season(file.read(_MAX_BYTES + 1), where=path.name)
    except OSError as error:
        raise SeasonError(f"{name}: {error.strerror}") from error


def read_season(data: bytes, *, where: str) -> Season:
    """The season of a YAML text.

    Args:
        data: The text.
        where: What messages call it.

    Raises:
        SeasonError: It is none; the message names the place.
    """
    if len(data) > _MAX_BYTES:
        raise SeasonError(f"{where}: at most {_MAX_BYTES:,} bytes are read")
    try:
        content = yaml.safe_load(data)
    except yaml.YAMLError as error:
        raise SeasonError(f"{where}: not valid YAML: {' '.join(str(error).split())}") from error
    return season_of(content, where=where)


def season_of(content: object, *, where: str) -> Season:
    """The season of a document's values; see `read_season`."""
    try:
        return Season.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        message = first["msg"].removeprefix("Value error, ")
        raise SeasonError(f"{where}: {place + ': ' if place else ''}{message}") from error
