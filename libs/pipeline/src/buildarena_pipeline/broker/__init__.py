"""Celery's application, the queues, and the watchdog of their consumer."""
