"""Scores of jobs, their verifications and audits."""
