"""What operators see: logs, traces, and figures of jobs and of the database."""
