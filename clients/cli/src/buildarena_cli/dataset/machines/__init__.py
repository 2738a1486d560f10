"""Machines as a dataset: drawn by a seed, tried and scored, without a service."""
