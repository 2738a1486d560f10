"""Suspensions and gears: machines with joints and motors."""
