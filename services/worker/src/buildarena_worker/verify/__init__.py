"""Verification: a finished job is replayed without a model, re-simulated, and compared.

A job's id enters, a report leaves: its verdict, and each comparison with what is stored and what
came out now. Everything that a score rests on is made again: the session from its journal, the
machine it built, the trajectory of each rollout, and the score; figures are compared exactly. The
stored bytes of every artifact are read and hashed.

A figure that comes out different refutes the job, if it came of the same versions of everything.
What can't be made again here, because a version differs or something is missing or damaged, makes
the verification inconclusive: nothing follows from it.
"""
