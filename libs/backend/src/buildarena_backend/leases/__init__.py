"""Leases: who may work on a job, for how long, and recovery of lost leases."""
