"""Requests of the API, defined once as coroutines over any transport."""
