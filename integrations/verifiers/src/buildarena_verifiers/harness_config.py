"""Settings of the harness, by which tasks identify it."""

import verifiers.v1 as vf


class BuildHarnessConfig(vf.HarnessConfig):
    """Settings of the harness, which adds none."""
