"""Settings of the harness, which the tasks know it by."""

import verifiers.v1 as vf


class BuildHarnessConfig(vf.HarnessConfig):
    """The harness has no settings of its own."""
