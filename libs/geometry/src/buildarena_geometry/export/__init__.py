"""Machines for the eye: GLB files for any 3D viewer, and SVG drawings for documents."""

from buildarena_geometry.export.glb import machine_glb
from buildarena_geometry.export.svg import View, machine_svg, module_svg

__all__ = ["View", "machine_glb", "machine_svg", "module_svg"]
