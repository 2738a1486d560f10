"""Build machines block by block; every step is checked."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split
from importlib.metadata import version

from buildarena_geometry.blocks import Block, Connector, Joint, KeyPress
from buildarena_geometry.documents.write import DOCUMENT_VERSION
from buildarena_geometry.errors import CatalogueError, DocumentError, GeometryError, SequenceError
from buildarena_geometry.feedback import FEEDBACK_VERSION
from buildarena_geometry.keys import KEYS
from buildarena_geometry.machine import Machine, replay
from buildarena_geometry.modules.catalogue import load_catalogue
from buildarena_geometry.modules.module import Catalogue, Module
from buildarena_geometry.modules.sets import (
    MODULE_SETS,
    catalogue_of,
    module_set,
    modules_named,
    simulated_modules,
)
from buildarena_geometry.modules.solids import Ball, Box, Cylinder
from buildarena_geometry.outcomes import (
    Accepted,
    AttemptedBlock,
    Cause,
    Outcome,
    RefusalClass,
    Refused,
)
from buildarena_geometry.poses import Pose
from buildarena_geometry.steps import Difference, step
from buildarena_geometry.tools import (
    GROUPS,
    LOOKUP,
    PROGRAM,
    ToolDefinition,
    object_schema,
    tool_definitions,
)

__version__ = version("buildarena-geometry")

__all__ = [
    "DOCUMENT_VERSION",
    "FEEDBACK_VERSION",
    "GROUPS",
    "KEYS",
    "LOOKUP",
    "MODULE_SETS",
    "PROGRAM",
    "Accepted",
    "AttemptedBlock",
    "Ball",
    "Block",
    "Box",
    "Catalogue",
    "CatalogueError",
    "Cause",
    "Connector",
    "Cylinder",
    "Difference",
    "DocumentError",
    "GeometryError",
    "Joint",
    "KeyPress",
    "Machine",
    "Module",
    "Outcome",
    "Pose",
    "RefusalClass",
    "Refused",
    "SequenceError",
    "ToolDefinition",
    "__version__",
    "catalogue_of",
    "load_catalogue",
    "module_set",
    "modules_named",
    "object_schema",
    "replay",
    "simulated_modules",
    "step",
    "tool_definitions",
]
