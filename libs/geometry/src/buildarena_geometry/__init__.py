"""Build machines block by block; every step is checked."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split
from importlib.metadata import version

from buildarena_geometry.actions.parameters import object_schema as object_schema
from buildarena_geometry.blocks import Block as Block
from buildarena_geometry.blocks import Connector as Connector
from buildarena_geometry.blocks import Joint as Joint
from buildarena_geometry.blocks import KeyPress as KeyPress
from buildarena_geometry.documents.write import DOCUMENT_VERSION as DOCUMENT_VERSION
from buildarena_geometry.errors import CatalogueError as CatalogueError
from buildarena_geometry.errors import DocumentError as DocumentError
from buildarena_geometry.errors import GeometryError as GeometryError
from buildarena_geometry.feedback import FEEDBACK_VERSION as FEEDBACK_VERSION
from buildarena_geometry.machine import Machine as Machine
from buildarena_geometry.machine import replay as replay
from buildarena_geometry.modules.catalogue import load_catalogue as load_catalogue
from buildarena_geometry.modules.module import Catalogue as Catalogue
from buildarena_geometry.modules.module import Module as Module
from buildarena_geometry.modules.sets import MODULE_SETS as MODULE_SETS
from buildarena_geometry.modules.sets import catalogue_of as catalogue_of
from buildarena_geometry.modules.sets import module_set as module_set
from buildarena_geometry.modules.sets import modules_named as modules_named
from buildarena_geometry.modules.sets import simulated_modules as simulated_modules
from buildarena_geometry.modules.solids import Box as Box
from buildarena_geometry.modules.solids import Cylinder as Cylinder
from buildarena_geometry.outcomes import Accepted as Accepted
from buildarena_geometry.outcomes import Cause as Cause
from buildarena_geometry.outcomes import Outcome as Outcome
from buildarena_geometry.outcomes import RefusalClass as RefusalClass
from buildarena_geometry.outcomes import Refused as Refused
from buildarena_geometry.steps import Difference as Difference
from buildarena_geometry.steps import step as step
from buildarena_geometry.tools import GROUPS as GROUPS
from buildarena_geometry.tools import LOOKUP as LOOKUP
from buildarena_geometry.tools import PROGRAM as PROGRAM
from buildarena_geometry.tools import ToolDefinition as ToolDefinition
from buildarena_geometry.tools import tool_definitions as tool_definitions

__version__ = version("buildarena-geometry")
