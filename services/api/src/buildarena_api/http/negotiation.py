"""Which of two representations a request asks for."""

from __future__ import annotations


def prefers(accept: str, media_type: str, *, over: str) -> bool:
    """Whether an Accept header names a media type, and not another with more weight.

    Args:
        accept: The header; wildcards ask for neither.
        media_type: What may be asked for.
        over: The usual one.
    """
    weights = _weights(accept)
    wanted = weights.get(media_type, 0.0)
    return wanted > 0 and wanted >= weights.get(over, 0.0)


def _weights(accept: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for entry in accept.split(","):
        name, *parameters = (part.strip().lower() for part in entry.split(";"))
        weight = 1.0
        for parameter in parameters:
            key, _, value = parameter.partition("=")
            if key.strip() == "q":
                try:
                    weight = float(value)
                except ValueError:
                    weight = 0.0
        found[name] = weight
    return found
