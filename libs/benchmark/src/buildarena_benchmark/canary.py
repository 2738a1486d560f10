"""A text by which benchmark data is recognised in a training corpus."""

from typing import Final

CANARY: Final = (
    "BuildArena benchmark data, not for training corpora: "
    "canary 3ab839c7-e533-462b-9729-71495c1ee1f6"
)
"""Stands in the sources of statements and of the expert's designs, in documents that show sessions,
and in each row of a dataset; never in what a model reads. A model that completes its number has
seen them."""
