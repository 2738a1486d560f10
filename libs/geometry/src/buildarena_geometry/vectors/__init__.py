"""Replay of golden action sequences, for tests and the `replay` command."""
