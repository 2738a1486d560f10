"""Every request of the API, written once: as coroutines over any transport."""
