"""Specs, their jobs in the database, and estimates of their cost."""
