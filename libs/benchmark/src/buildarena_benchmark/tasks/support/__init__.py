"""Bridges that carry a load over a gap."""
