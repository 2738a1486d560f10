"""Texts about a machine that models read, short because each word costs tokens on every turn."""

FEEDBACK_VERSION = "5"
"""Changes with every change of wording: results of different ones don't compare."""
