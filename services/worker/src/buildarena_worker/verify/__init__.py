"""Verification: a finished job is replayed without a model, re-simulated, and compared.

The input is a job's id, the output a report: a verdict, and each comparison of a stored with a
recomputed value. Everything that a score depends on is recomputed: the session from its journal,
the machine it built, the trajectory of each rollout, and the score; figures are compared exactly.
The stored bytes of every artifact are read and hashed.

A figure that differs refutes the job if all versions are the same. What can't be recomputed here,
because a version differs or something is missing or damaged, makes the verification inconclusive.
"""
