"""What evidence says of itself: versions, steps, figures and verdicts. Bounded, as it is sent."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, Field

FORMAT: Final = 1
MAX_STEPS: Final = 64
MAX_RUNS: Final = 20
LONGEST_SENTENCE: Final = 2000


class EvidenceError(ValueError):
    """A file is no evidence that can be read; the message says what is wrong."""


class Verdict(StrEnum):
    """What a step says of an assumption."""

    CONFIRMED = "confirmed"
    CONTRADICTED = "contradicted"
    NOT_SEEN = "not_seen"


def _printable(text: str) -> str:
    if any(not (letter.isprintable() or letter == " ") for letter in text):
        raise ValueError("it has characters that cannot be printed")
    return text


def sentence_of(text: object) -> str:
    """A text as a sentence of evidence: one line of printable characters, bounded."""
    line = " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())
    return line if len(line) <= LONGEST_SENTENCE else line[: LONGEST_SENTENCE - 1] + "…"


Sentence = Annotated[str, Field(max_length=LONGEST_SENTENCE), AfterValidator(_printable)]
Word = Annotated[str, Field(max_length=100), AfterValidator(_printable)]
Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]
Pixels = Annotated[int, Field(ge=0, le=100_000)]
Figures = Annotated[dict[Word, Number | None], Field(max_length=100)]


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Versions(_Document):
    """Which programs it was, from files where they say so; "" for what is not known.

    Attributes:
        buildarena: Of the runner.
        game: Of the game, as the settings name it.
        mod: Of its Lua Scripting Mod, as the settings name it.
        build: Steam's number of the game's build, from Steam's files.
        mod_file: The mod's version in its own file.
    """

    buildarena: Word
    game: Word = ""
    mod: Word = ""
    build: Word = ""
    mod_file: Word = ""


class Point(_Document):
    """A point of the examination of a machine.

    Attributes:
        name: What was looked at.
        ok: Whether it is as it should be.
        detail: What was seen.
    """

    name: Word
    ok: bool
    detail: Sentence = ""


class Measured(_Document):
    """What only the runner could measure of a run, by its own clock.

    Attributes:
        pace: Seconds of the game per second of the wall clock.
        copies: How often the log was copied.
        longest_copy_s: How long the longest copy took, seconds.
        longest_pause_s: The longest time from the end of one copy to the next, seconds.
    """

    pace: Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e4)]
    copies: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    longest_copy_s: Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e4)] = 0.0
    longest_pause_s: Annotated[float, Field(allow_inf_nan=False, ge=0, le=1e4)] = 0.0


class RunRecord(_Document):
    """One run of a trial.

    Attributes:
        number: From 1.
        run_id: Which lines of its log are its own.
        measured: What the runner measured.
        faults: What went wrong in earlier attempts.
    """

    number: Annotated[int, Field(ge=1, le=MAX_RUNS)]
    run_id: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,100}$")]
    measured: Measured
    faults: Annotated[tuple[Sentence, ...], Field(max_length=20)] = ()


class EngineRecord(_Document):
    """What one of our engines makes of a trial, from the place where the game puts the machine.

    Attributes:
        simulation: Version of the model.
        figures: As those of the game.
    """

    simulation: Word
    figures: Figures = {}


class Judgement(_Document):
    """What a step says of an assumption.

    Attributes:
        assumption: Its name.
        verdict: Whether it holds.
        seen: What was seen, in a sentence.
        stated: The sender's own verdict, where the files say something else; None otherwise.
    """

    assumption: Word
    verdict: Verdict
    seen: Sentence
    stated: Verdict | None = None


class StepRecord(_Document):
    """What came of a step.

    Attributes:
        name: The step's.
        state: Whether it was done; "left_out" where it cannot be done here.
        detail: Why it failed or was left out; "" for one that was done.
        points: Of an examination.
        runs: Of a trial.
        engines: What our engines say of the trial, by engine.
        figures: What the files show, by "game 1" and so on, and by engine.
        judgements: Of each assumption that the step is about.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9-]{1,40}$")]
    state: Literal["done", "failed", "left_out"]
    detail: Sentence = ""
    points: Annotated[tuple[Point, ...], Field(max_length=50)] = ()
    runs: Annotated[tuple[RunRecord, ...], Field(max_length=MAX_RUNS)] = ()
    engines: Annotated[dict[Word, EngineRecord], Field(max_length=8)] = {}
    figures: Annotated[dict[Word, Figures], Field(max_length=100)] = {}
    judgements: Annotated[tuple[Judgement, ...], Field(max_length=50)] = ()


class Evidence(_Document):
    """What a first evening with a game showed.

    Attributes:
        format: Of this document.
        made_at: When it was packed.
        versions: Of game, mod and runner.
        driver: How the game was driven.
        screen: (width, height) of what the game draws, pixels; None if it did not say.
        steps: In the order of the registry.
    """

    format: Literal[1]
    made_at: AwareDatetime
    versions: Versions
    driver: Literal["window", "headless", "toolkit"]
    screen: tuple[Pixels, Pixels] | None = None
    steps: Annotated[tuple[StepRecord, ...], Field(max_length=MAX_STEPS)]
