"""What the geometry tests share: where their data is, and a way to build machines in one line."""

import pytest
from hypothesis import settings
from support.machines.building import built

# A slow machine must not make a law look broken.
settings.register_profile("geometry", deadline=None, print_blob=True)
settings.load_profile("geometry")


@pytest.fixture
def build():
    """Builds a machine from (base, face, module) triples and fails if a step is refused."""
    return built
