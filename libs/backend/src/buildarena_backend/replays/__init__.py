"""How machines came about: the kept actions done again, chapter by chapter."""
