"""What models read about a machine. Short on purpose: every word is paid for on every turn."""

FEEDBACK_VERSION = "5"
"""Changes with every change of wording: results of different ones don't compare."""
