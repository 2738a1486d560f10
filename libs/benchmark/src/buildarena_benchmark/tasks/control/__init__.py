"""Machines that a program steers by their sensors."""
