"""Self-contained pages that show machines and trials, isolated in their frame.

A page makes no requests, which its policy enforces. Its content may come from untrusted documents,
so it is encoded such that nothing of it is markup.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
from dataclasses import asdict, dataclass
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from buildarena_benchmark import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

SCRIPT: Final = Path(__file__).parent / "viewer" / "viewer.js"
"""The viewer, where it was built: `make web` does, and wheels carry it."""
FRAME_HEIGHT: Final = 420
MISSING: Final = (
    "The 3D viewer was not built into this installation (`make web` builds it), so this is a "
    "drawing."
)
POLICY: Final = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'"
LOADER: Final = """
const packed = document.getElementById("viewer").textContent;
const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
const unpacked = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
new Response(unpacked).text().then((text) => {
  const script = document.createElement("script");
  script.textContent = text;
  document.head.append(script);
});
"""
_MOST_LOADED: Final = 4_000_000
"""Figures of a series of loads; longer ones are left out, as a page would not open."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A page's content: a machine, or its trial.

    Attributes:
        task: Task of the trial.
        trajectory: Trajectory of the trial; None to show the machine as built.
        height: Height of the frame, pixels.
        heading: Text above the frame; "" for none.
    """

    title: str
    machine: Machine
    height: int
    task: Task | None = None
    trajectory: Trajectory | None = None
    heading: str = ""

    def frame(self) -> str:
        """Return HTML for a notebook: the page in a sandboxed frame."""
        if not SCRIPT.is_file():
            return self._draw()
        return (
            f'<iframe sandbox="allow-scripts" srcdoc="{escape(self.page())}" '
            f'title="{escape(self.title)}" width="100%" height="{self.height}" '
            'style="border: 0" loading="lazy"></iframe>'
        )

    def page(self) -> str:
        """Return a self-contained page."""
        title = f'<meta charset="utf-8"><title>{escape(self.title)}</title>'
        if self.heading:
            title += f'<meta name="description" content="{escape(self.heading)}">'
        if not SCRIPT.is_file():
            return f"<!doctype html><html><head>{title}</head><body>{self._draw()}</body></html>"
        return (
            f"<!doctype html><html><head>{title}"
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}"></head>'
            '<body><div id="root">This is drawn by a script.</div>'
            f'<script type="text/plain" id="given">{_packed(self._document())}</script>'
            f'<script type="text/plain" id="viewer">{_viewer()}</script>'
            f"<script>{LOADER}</script></body></html>"
        )

    def _draw(self) -> str:
        """Return the geometry library's drawing as an image, whose scripts do not run."""
        if not self.machine.started:
            return f"<p>{escape(MISSING)} The machine is empty.</p>"
        from buildarena_geometry.export import machine_svg

        drawing = base64.b64encode(machine_svg(self.machine).encode()).decode()
        return (
            f"<p>{escape(MISSING)}</p>"
            f'<img alt="{escape(self.title)}" src="data:image/svg+xml;base64,{drawing}" '
            f'style="max-height: {self.height}px; background: white">'
        )

    def _document(self) -> dict[str, Any]:
        from buildarena_api.scenes import machine_scene
        from buildarena_simulation import world_of

        world = None if self.task is None else self.task.scenario
        if world is not None and self.trajectory is not None:
            world = world_of(world, self.trajectory)
        return {
            "title": self.title,
            "heading": self.heading,
            "machine": machine_scene(self.machine).model_dump(mode="json"),
            "scenario": None if world is None else world.model_dump(mode="json"),
            "trial": None if self.trajectory is None else _trial(self.trajectory),
        }


def _packed(document: dict[str, Any]) -> str:
    """Return JSON, gzipped, in base64, which can't end an element."""
    return _packed_bytes(json.dumps(_finite(document), allow_nan=False).encode())


def _finite(value: Any) -> Any:
    """Return a value with null for numbers that JSON can't represent, as in diverged trials."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value


@cache
def _viewer() -> str:
    return _packed_bytes(SCRIPT.read_bytes())


def _packed_bytes(data: bytes) -> str:
    # Without a time, so that equal things are equal pages.
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode()


def _trial(trajectory: Trajectory) -> dict[str, Any]:
    """Return a trajectory as `clients/web/src/viewer/given.ts` reads it."""
    loads = trajectory.joint_loads
    return {
        "times": _bytes(trajectory.time_s, "<f8"),
        "block_ids": list(trajectory.block_ids),
        "positions": _bytes(trajectory.positions, "<f4"),
        "quaternions": _bytes(trajectory.quaternions, "<f4"),
        "cargo": _cargo(trajectory),
        "joint_peaks": [asdict(peak) for peak in trajectory.joint_peaks],
        "joint_loads": None if loads is None or loads.size > _MOST_LOADED else _bytes(loads, "<f4"),
        "breaks": [asdict(event) for event in trajectory.breaks],
        "engine": trajectory.engine,
        "engine_version": trajectory.engine_version,
    }


def _cargo(trajectory: Trajectory) -> dict[str, Any] | None:
    places, turns, masses = (
        trajectory.cargo_position,
        trajectory.cargo_quaternion,
        trajectory.cargo_mass,
    )
    if places is None or turns is None or masses is None or trajectory.cargo_size is None:
        return None
    return {
        "size": list(trajectory.cargo_size),
        "shape": trajectory.cargo_shape,
        "positions": _bytes(places, "<f4"),
        "quaternions": _bytes(turns, "<f4"),
        "mass": _bytes(masses, "<f8"),
    }


def _bytes(array: NDArray[np.floating[Any]], kind: str) -> str:
    """Return an array's figures row by row, including those that are not finite."""
    return base64.b64encode(array.astype(kind).tobytes()).decode()
