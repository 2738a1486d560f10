"""The model layer: one neutral request to any provider, with declared retries and prices."""

from buildarena_worker.providers.clients import ModelClients

__all__ = ["ModelClients"]
