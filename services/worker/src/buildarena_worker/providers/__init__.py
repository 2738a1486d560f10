"""The model layer: one neutral request to any provider, with declared retries and prices."""
