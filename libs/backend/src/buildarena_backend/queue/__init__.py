"""Celery's queues: hints that there is work, sent, read, and checked."""
