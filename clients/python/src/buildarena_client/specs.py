"""Sweeps as fields or as a YAML file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from buildarena_client.errors import BadArgumentError, MissingLibraryError

MAX_BYTES: Final = 2 * 1024 * 1024
"""Largest file: room for the 100,000 seeds that a sweep can name."""


def spec_of(spec: Mapping[str, Any] | Path) -> dict[str, Any]:
    """The fields of a sweep.

    Args:
        spec: The fields, or the YAML file that has them.

    Raises:
        BadArgumentError: The file can't be read, or holds something other than a mapping.
        MissingLibraryError: YAML can't be read without a library.
    """
    if isinstance(spec, Mapping):
        return dict(spec)
    if not isinstance(spec, Path):
        raise BadArgumentError(
            f"{spec!r} is not a sweep: give its fields, or the Path of the file that has them"
        )
    try:
        import yaml
    except ImportError as error:
        raise MissingLibraryError(
            "reading a sweep's file", library="PyYAML", extra="yaml"
        ) from error
    try:
        if spec.stat().st_size > MAX_BYTES:
            raise BadArgumentError(f"{spec} has more than {MAX_BYTES:,} bytes")
        content = yaml.safe_load(spec.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadArgumentError(f"{spec}: {error.strerror}") from error
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise BadArgumentError(f"{spec} is not valid YAML: {error}") from error
    if not isinstance(content, dict):
        raise BadArgumentError(f"{spec} must be a mapping of fields, such as tasks: [support-1]")
    return content
