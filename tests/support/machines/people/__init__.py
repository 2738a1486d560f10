"""Machines of the shapes that people build: bridges, cars, rockets, gliders, winches, hoverers.

They are honest: each is meant to do what its task asks for, well or badly.
"""
