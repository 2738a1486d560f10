"""Module types: what blocks and connectors are made from, read from one file."""
