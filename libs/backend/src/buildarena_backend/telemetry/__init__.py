"""Telemetry for operators: logs, traces, and figures of jobs and of the database."""
