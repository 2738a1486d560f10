"""Build machines block by block; every step is checked."""
