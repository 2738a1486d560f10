"""How trials are judged: what a scorer is, shared measures, and scorers that categories share."""
