"""How jobs' machines came about, as the API answers it."""
