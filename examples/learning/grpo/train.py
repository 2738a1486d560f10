"""Trains a small policy by GRPO through verifiers: `train.py --task support-1 --out learned`.

The same command gives the same curve. What was learned is written after every update, and a run
that was interrupted goes on when its command is given again.
"""

from __future__ import annotations

import os

if __name__ == "__main__":  # processes that try machines import this module again, and need no more
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
    from buildarena_geometry import kernels  # noqa: F401 -- before numpy

    # isort: split

    from training import main

    main(__doc__)
