"""Suspensions and gears: what joints and motors make of a machine."""
