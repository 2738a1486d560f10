"""The former name of ``buildarena_client.retries``, for one release."""

from __future__ import annotations

import warnings

from buildarena_client.retries import RetryPolicy

Patience = RetryPolicy

warnings.warn("buildarena_client.patience is now .retries", DeprecationWarning, stacklevel=2)
