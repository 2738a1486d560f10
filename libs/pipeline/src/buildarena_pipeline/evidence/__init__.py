"""Evidence of the real game: what is assumed of it, and what a first evening with it showed.

A runner plays the steps (`STEPS`), and packs what came of them into one file (`write_evidence`).
Whoever receives one reads it as a stranger's (`read_evidence`), and judges its logs again
(`judged`): no verdict in it is believed.
"""

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from buildarena_pipeline.evidence.assumptions import ASSUMPTIONS, Assumption
from buildarena_pipeline.evidence.document import (
    FORMAT,
    Evidence,
    EvidenceError,
    Judgement,
    Measured,
    RunRecord,
    StepRecord,
    Verdict,
    Versions,
)
from buildarena_pipeline.evidence.packing import write_evidence
from buildarena_pipeline.evidence.page import page
from buildarena_pipeline.evidence.reading import ReadEvidence, read_evidence
from buildarena_pipeline.evidence.steps import STEPS, Step, judged, step_named
from buildarena_pipeline.evidence.table import EvidenceTable, table_of
from buildarena_pipeline.evidence.trials import Trial, trial_named

__all__ = [
    "ASSUMPTIONS",
    "FORMAT",
    "STEPS",
    "Assumption",
    "Evidence",
    "EvidenceError",
    "EvidenceTable",
    "Judgement",
    "Measured",
    "ReadEvidence",
    "RunRecord",
    "Step",
    "StepRecord",
    "Trial",
    "Verdict",
    "Versions",
    "judged",
    "page",
    "read_evidence",
    "step_named",
    "table_of",
    "trial_named",
    "write_evidence",
]
