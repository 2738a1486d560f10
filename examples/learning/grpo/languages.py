"""What a small policy reads and writes: words of a conversation, and the tool calls they stand for.

A language takes a tokenizer's place. Its grammar says which words may come next, as guided decoding
does for a language model, so that every message is one of well-formed tool calls. Whether a call is
accepted is for the environment to say.
"""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final

ACCEPTED, REFUSED = "accepted", "refused"
END, SUBMIT = "end", "submit"
ENDS: Final = frozenset((END, SUBMIT))
"""Words that complete a message."""
WOOD: Final = "Small Wooden Block"


@dataclass(frozen=True, slots=True)
class Call:
    """A tool call: the tool's name and its arguments."""

    tool: str
    arguments: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Said:
    """A message of a conversation, as far as the policy reads it.

    Attributes:
        role: `assistant` or `tool`; others are passed over.
        calls: What an assistant's message calls.
        text: What a tool answered.
    """

    role: str
    calls: tuple[Call, ...] = ()
    text: str = ""


class Language(ABC):
    """Vocabulary, grammar and meaning of what is written for one task.

    The first assistant message, `opening`, is given and no part of what is learned.
    """

    task: ClassVar[str]
    opening: ClassVar[tuple[Call, ...]]
    vocabulary: ClassVar[tuple[str, ...]]
    """All words: the task's name first, which stands for the prompt; those written; those heard."""
    longest: ClassVar[int]
    """Words that a conversation has at most."""
    rare: ClassVar[frozenset[str]] = frozenset()
    """Words that an ignorant policy writes an eighth as often as others, so as not to end early."""

    @abstractmethod
    def choices(self, words: Sequence[str]) -> tuple[str, ...]:
        """The words that may come next in a conversation; none where a message is complete."""

    @abstractmethod
    def calls(self, written: Sequence[str]) -> tuple[Call, ...]:
        """The tool calls that a complete message stands for."""

    @abstractmethod
    def written(self, calls: Sequence[Call]) -> Iterator[str]:
        """The words of a message with these tool calls."""

    @abstractmethod
    def heard(self, answer: str) -> str:
        """The word that stands for a tool's answer."""

    def read(self, messages: Sequence[Said]) -> tuple[list[str], list[bool]]:
        """A conversation as words, and which of them the policy wrote."""
        words, own = [self.task], [False]
        spoken = 0
        for message in messages:
            if message.role == "assistant":
                spoken += 1
            if spoken <= 1:  # the opening and its answers
                continue
            new = (
                list(self.written(message.calls))
                if message.role == "assistant"
                else [self.heard(message.text)]
                if message.role == "tool"
                else []
            )
            words += new
            own += [message.role == "assistant"] * len(new)
        return words, own


class Bridges(Language):
    """Building calls: a message of blocks, their answers, and a message of braces.

    Blocks are attached to the first or the newest one, straight on or around a corner. A face is
    used once. Neither that blocks must span the gap nor where braces belong is said.
    """

    task = "support-1"
    opening = (Call("start", {}),)
    BLOCKS, BRACES = 12, 10
    SIDES: Final = ("A", "E", "F")
    BRACED: Final = ("A", "B", "C", "D")
    NUMBERS: Final = tuple(str(number) for number in range(1, BLOCKS + 2))
    vocabulary = (
        task,
        *("attach", "first", "newest", "brace", END, SUBMIT),
        *("A", "B", "C", "D", "E", "F"),
        *NUMBERS,
        *(ACCEPTED, REFUSED),
    )
    longest = 1 + 3 * BLOCKS + 1 + BLOCKS + 5 * BRACES + 1
    rare = ENDS

    def choices(self, words: Sequence[str]) -> tuple[str, ...]:
        """See `Language`."""
        if END not in words:
            return self._of_blocks(words[1:])
        blocks = 1 + words.count(ACCEPTED)
        own = words[words.index(END) + 1 :]
        return self._of_braces([word for word in own if word not in (ACCEPTED, REFUSED)], blocks)

    def _of_blocks(self, own: Sequence[str]) -> tuple[str, ...]:
        made, place = divmod(len(own), 3)
        if place == 0:
            return (*["attach"] * (made < self.BLOCKS), *[END] * (made > 0))
        faces = self._free_faces(own[: 3 * made])
        if place == 1:
            return tuple(base for base, free in faces.items() if free)
        return faces[own[-1]]

    def _free_faces(self, own: Sequence[str]) -> dict[str, tuple[str, ...]]:
        """The faces that nothing was attached to; the newest block sits on its face F."""
        first = {own[place + 2] for place in range(0, len(own), 3) if own[place + 1] == "first"}
        free = {"first": tuple(side for side in self.SIDES if side not in first)}
        return free | ({"newest": ("A", "E")} if own else {})

    def _of_braces(self, own: Sequence[str], blocks: int) -> tuple[str, ...]:
        if SUBMIT in own:
            return ()
        made, place = divmod(len(own), 5)
        if place == 0:
            return (*["brace"] * (made < self.BRACES and blocks > 1), SUBMIT)
        if place in (2, 4):
            return self.BRACED
        taken = own[-2:-1] if place > 1 else ()
        return tuple(number for number in self.NUMBERS[:blocks] if number not in taken)

    def calls(self, written: Sequence[str]) -> tuple[Call, ...]:
        """See `Language`."""
        made: list[Call] = []
        words = iter(written)
        for word in words:
            if word == "attach":
                base = "1" if next(words) == "first" else str(len(made) + 1)
                told = {"base_block": base, "face": next(words), "new_block": WOOD}
                made.append(Call("attach_block_to", told))
            elif word == "brace":
                names = ("block_a", "face_a", "block_b", "face_b")
                ends = {name: next(words) for name in names}
                made.append(Call("connect_blocks", {**ends, "connector": "Brace"}))
            elif word == SUBMIT:
                made.append(Call(SUBMIT, {}))
        return tuple(made)

    def written(self, calls: Sequence[Call]) -> Iterator[str]:
        """See `Language`."""
        for call in calls:
            told = call.arguments
            if call.tool == "attach_block_to":
                yield from ("attach", "first" if told["base_block"] == "1" else "newest")
                yield told["face"]
            elif call.tool == "connect_blocks":
                yield from ("brace", told["block_a"], told["face_a"])
                yield from (told["block_b"], told["face_b"])
        yield SUBMIT if calls and calls[-1].tool == SUBMIT else END

    def heard(self, answer: str) -> str:
        """See `Language`."""
        return ACCEPTED if answer.startswith("Attached.") else REFUSED


class Balancing(Language):
    """A controller program: a sum of senses, each times a gain, as the speed of both wheels.

    The opening builds the machine, a cart of one axle with a mast. Which senses matter, their signs
    and their gains are not said.
    """

    task = "balance-1"
    TERMS = 4
    SIGNS: Final = ("+", "-")
    GAINS: Final = ("0.1", "0.2", "0.5", "1", "2", "5", "10")
    SENSES: Final = (
        *(f"{name}.{axis}" for name in ("up", "forward", "spin", "body_spin") for axis in "xyz"),
        *(f'wheels["{wheel}"].speed' for wheel in (4, 7)),
    )
    opening = (
        Call("start", {}),
        *(
            Call("attach_block_to", {"base_block": base, "face": face, "new_block": module})
            for base, face, module in (
                ("1", "A", WOOD),
                ("2", "E", WOOD),
                ("3", "E", "Powered Wheel"),
                ("1", "B", WOOD),
                ("5", "E", WOOD),
                ("6", "E", "Powered Wheel"),
            )
        ),
        Call("flip_spin", {"block_id": "7"}),
        *(
            Call("attach_block_to", {"base_block": base, "face": face, "new_block": "Log"})
            for base, face in (("1", "C"), ("8", "N"), ("9", "N"))
        ),
    )
    vocabulary = (task, *SIGNS, *GAINS, *SENSES, SUBMIT, ACCEPTED, REFUSED)
    longest = 1 + 3 * TERMS + 1
    PROGRAM: Final = "function control(t, sense)\n  return {{ spinning_forward = 0{sum} }}\nend\n"
    TERM: Final = re.compile(r" ([+-]) (\S+) \* sense\.(\S+)")

    def choices(self, words: Sequence[str]) -> tuple[str, ...]:
        """See `Language`."""
        if SUBMIT in words:
            return ()
        made, place = divmod(len(words) - 1, 3)
        if place == 0:
            return (*self.SIGNS * (made < self.TERMS), *[SUBMIT] * (made > 0))
        return self.GAINS if place == 1 else self.SENSES

    def calls(self, written: Sequence[str]) -> tuple[Call, ...]:
        """See `Language`."""
        terms = "".join(
            f" {sign} {gain} * sense.{sense}"
            for sign, gain, sense in zip(written[0::3], written[1::3], written[2::3], strict=False)
        )
        return Call("set_controller", {"program": self.PROGRAM.format(sum=terms)}), Call(SUBMIT, {})

    def written(self, calls: Sequence[Call]) -> Iterator[str]:
        """See `Language`."""
        for term in self.TERM.findall(str(calls[0].arguments["program"])):
            yield from term
        yield SUBMIT

    def heard(self, answer: str) -> str:
        """See `Language`."""
        return REFUSED if answer.startswith("Not set") else ACCEPTED


LANGUAGES: Final[Mapping[str, Language]] = {
    language.task: language for language in (Bridges(), Balancing())
}


def said(messages: Sequence[Mapping[str, Any]]) -> list[Said]:
    """The messages of a request in OpenAI's form."""
    return [
        Said(
            role=message["role"],
            calls=tuple(
                Call(call["function"]["name"], json.loads(call["function"]["arguments"]))
                for call in message.get("tool_calls") or ()
            ),
            text=message.get("content") or "",
        )
        for message in messages
    ]
