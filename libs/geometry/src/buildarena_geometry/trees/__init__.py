"""Construction trees, BesiegeField's format of machines: read, checked and built by actions."""

from buildarena_geometry.trees.building import TreeAction, tree_actions
from buildarena_geometry.trees.points import POINTING, point_text, points_of, points_text
from buildarena_geometry.trees.reading import (
    MAX_ENTRIES,
    TreeEntry,
    looks_like_tree,
    read_tree,
    tree_in,
)

__all__ = [
    "MAX_ENTRIES",
    "POINTING",
    "TreeAction",
    "TreeEntry",
    "looks_like_tree",
    "point_text",
    "points_of",
    "points_text",
    "read_tree",
    "tree_actions",
    "tree_in",
]
