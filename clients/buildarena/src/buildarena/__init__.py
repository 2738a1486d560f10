"""All of BuildArena: this distribution installs its parts, which have packages of their own."""

__version__ = "0.1.0"
