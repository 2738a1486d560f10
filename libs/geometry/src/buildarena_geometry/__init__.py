"""Build machines block by block; every step is checked."""

from .blocks import Block, Connector, Joint, KeyPress
from .catalogue import load_catalogue
from .documents import DOCUMENT_VERSION
from .errors import CatalogueError, DocumentError, GeometryError, SequenceError
from .feedback import FEEDBACK_VERSION
from .keys import KEYS
from .log import ActionLog, ActionRecord
from .machine import Machine, replay
from .modules import Box, Catalogue, Cylinder, Face, Landmark, Module
from .outcomes import Accepted, Cause, Outcome, RefusalClass, Refused
from .poses import Pose
from .tools import GROUPS, ToolDefinition, tool_definitions

__version__ = "0.1.0"

__all__ = [
    "DOCUMENT_VERSION",
    "FEEDBACK_VERSION",
    "GROUPS",
    "KEYS",
    "Accepted",
    "ActionLog",
    "ActionRecord",
    "Block",
    "Box",
    "Catalogue",
    "CatalogueError",
    "Cause",
    "Connector",
    "Cylinder",
    "DocumentError",
    "Face",
    "GeometryError",
    "Joint",
    "KeyPress",
    "Landmark",
    "Machine",
    "Module",
    "Outcome",
    "Pose",
    "RefusalClass",
    "Refused",
    "SequenceError",
    "ToolDefinition",
    "__version__",
    "load_catalogue",
    "replay",
    "tool_definitions",
]
