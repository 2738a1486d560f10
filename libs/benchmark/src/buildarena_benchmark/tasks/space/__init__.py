"""Flights round a small planet."""
