"""Simulators: what one is, which are installed here, and which jobs can name."""
