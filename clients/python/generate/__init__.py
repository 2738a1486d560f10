"""Writes what of the Python client is not written by hand."""
