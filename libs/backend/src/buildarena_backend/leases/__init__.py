"""Leases: exclusive rights to work on a job for a time, and recovery of lost ones."""
