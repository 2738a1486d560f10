"""Machines that a program steers by what it senses."""
