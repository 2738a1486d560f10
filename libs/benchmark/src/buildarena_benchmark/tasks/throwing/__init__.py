"""Machines that throw a boulder: far, or through rings."""
