"""The Python client of BuildArena's HTTP API, synchronous and asynchronous."""
