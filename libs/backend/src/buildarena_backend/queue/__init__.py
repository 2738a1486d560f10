"""Celery's queues: sending, receiving and checking of hints that jobs wait."""
