"""Sessions of external agents over the tools API."""
