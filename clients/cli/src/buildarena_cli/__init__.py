"""The buildarena command line."""
