"""Machines for the eye: GLB files for any 3D viewer, and SVG drawings for documents."""

from .glb import machine_glb
from .svg import View, machine_svg

__all__ = ["View", "machine_glb", "machine_svg"]
