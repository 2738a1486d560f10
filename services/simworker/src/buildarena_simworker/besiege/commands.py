"""The words of a command as the operating system splits it."""

from __future__ import annotations

import shlex
import sys


def command_words(command: str, *, windows: bool = sys.platform == "win32") -> list[str]:
    """The words of a command.

    On Windows backslashes are part of paths, and quotes hold words with blanks together without
    becoming part of them; elsewhere the shell's rules count.

    Args:
        command: As a person writes it.
        windows: Whether Windows' rules count.

    Raises:
        ValueError: A quotation has no end.
    """
    if not windows:
        return shlex.split(command)
    words: list[str] = []
    word, quoted, begun = "", False, False
    rest = command
    while rest:
        slashes = len(rest) - len(rest.lstrip("\\"))
        letter = rest[slashes : slashes + 1]
        rest = rest[slashes + 1 :]
        if letter == '"':
            # Backslashes are special before a quote only: two are one, one more makes it a letter.
            word += "\\" * (slashes // 2)
            if slashes % 2:
                word += '"'
            else:
                quoted = not quoted
            begun = True
            continue
        word += "\\" * slashes
        begun = begun or bool(slashes)
        if letter and letter in " \t" and not quoted:
            if begun:
                words.append(word)
            word, begun = "", False
        elif letter:
            word += letter
            begun = True
    if quoted:
        raise ValueError(f"a quotation in {command!r} has no end")
    return [*words, word] if begun else words
