"""Permissions and spending: API keys, budgets, reservations."""
