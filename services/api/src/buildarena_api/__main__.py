"""Starts the API: ``python -m buildarena_api``."""

from __future__ import annotations

import gc
from importlib import import_module

# A sixth of the time to start went into looking through what had been loaded so far.
gc.disable()
import_module("buildarena_api.starting").main()
