"""A stand-in for the game Besiege with its Lua mod: a window to be driven, and physics of ours.

It reads machine files with a parser of its own and imports nothing of buildarena_besiege, so that a
mistake in our files cannot hide behind the same mistake in their reader.
"""
