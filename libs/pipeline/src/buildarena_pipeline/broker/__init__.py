"""The only place that knows Celery and Redis."""
