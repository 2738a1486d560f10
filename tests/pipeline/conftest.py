from __future__ import annotations

import pytest

from buildarena_pipeline.context import Context
from buildarena_pipeline.models import load_registry
from buildarena_pipeline.submission import Submissions


@pytest.fixture
def submissions(context: Context) -> Submissions:
    return Submissions(context, load_registry())
