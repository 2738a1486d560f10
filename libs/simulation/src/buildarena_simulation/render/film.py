"""Writes a trial as a film (mp4, gif) or as a sheet of pictures (png)."""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.render.camera import Camera
from buildarena_simulation.render.drawing import draw
from buildarena_simulation.render.planet import Flight
from buildarena_simulation.render.scene import Scene
from buildarena_simulation.rollout import world_of

if TYPE_CHECKING:
    from PIL.Image import Image

    from buildarena_geometry import Machine
    from buildarena_simulation.scenario import Scenario
    from buildarena_simulation.trajectory import Trajectory

FORMATS: Final = ("mp4", "gif", "png")

_SIZE: Final = (960, 540)
_SHEET: Final = (3, 2)
_SHEET_FRAME: Final = (640, 420)
_GIF_EVERY: Final = 3
_GIF_SIZE: Final = (640, 360)
_CODECS: Final = ("libx264", "mpeg4")


def write_film(
    machine: "Machine",
    scenario: "Scenario",
    trajectory: "Trajectory",
    path: Path,
    *,
    on_progress: Callable[[float], None] | None = None,
) -> None:
    """Write a film or a sheet of pictures of a trial.

    Args:
        path: Output file; its suffix decides the format: mp4, gif, or png for six pictures on a
            sheet.
        on_progress: Callback for the completed share, 0 to 1.

    Raises:
        ValueError: The suffix is another.
        ImportError: The extra `video` is not installed.
    """
    kind = path.suffix.lstrip(".").lower()
    if kind not in FORMATS:
        raise ValueError(f"{path.name}: a film ends in {', '.join(FORMATS)}")
    world = world_of(scenario, trajectory)
    flight = None
    if world.planet is not None and len(trajectory.block_ids):
        flight = Flight(trajectory, world.planet.radius)
    views = Scene(machine, world, trajectory), flight
    count = len(trajectory.time_s)
    if kind == "png":
        samples = np.linspace(0, count - 1, _SHEET[0] * _SHEET[1]).round().astype(int)
        _write_sheet(list(_frames(views, trajectory, samples, _SHEET_FRAME, on_progress)), path)
    elif kind == "gif":
        samples = np.arange(0, count, _GIF_EVERY)
        _write_gif(list(_frames(views, trajectory, samples, _GIF_SIZE, on_progress)), path)
    else:
        _write_mp4(_frames(views, trajectory, np.arange(count), _SIZE, on_progress), path)


def _frames(
    views: tuple[Scene, Flight | None],
    trajectory: "Trajectory",
    samples: Sequence[int] | np.ndarray,
    size: tuple[int, int],
    on_progress: Callable[[float], None] | None,
) -> Iterator["Image"]:
    from PIL import ImageDraw

    scene, flight = views
    distance = 2.6 * scene.reach()
    for done, sample in enumerate(map(int, samples), 1):
        focus = scene.focus(sample) if flight is None else flight.focus(sample)
        camera = Camera.looking_at(
            focus, distance=distance, size=size, azimuth_deg=scene.azimuth_deg
        )
        picture, caption = scene.at(sample), _caption(trajectory, sample)
        if flight is None:
            image = draw(picture, camera, size=size, caption=caption)
        else:
            caption += f"\nheight {flight.height[sample]:.1f}"
            image = draw(flight.unrolled(picture, sample), camera, size=size, caption=caption)
            flight.draw_map(ImageDraw.Draw(image), size, sample)
        yield image
        if on_progress:
            on_progress(done / len(samples))


def _caption(trajectory: "Trajectory", sample: int) -> str:
    time_s = float(trajectory.time_s[sample])
    lines = [f"{trajectory.engine}   t = {time_s:.1f} s"]
    if trajectory.cargo_mass is not None:
        lines.append(f"cargo {trajectory.cargo_mass[sample]:.0f}")
    broken = sum(event.time_s <= time_s for event in trajectory.breaks)
    if broken:
        lines.append(f"{broken} joints broken")
    return "\n".join(lines)


def _write_sheet(frames: Sequence["Image"], path: Path) -> None:
    from PIL import Image

    width, height = _SHEET_FRAME
    columns, rows = _SHEET
    sheet = Image.new("RGB", (columns * width, rows * height))
    for k, frame in enumerate(frames):
        sheet.paste(frame, (k % columns * width, k // columns * height))
    sheet.save(path)


def _write_gif(frames: Sequence["Image"], path: Path) -> None:
    first, *remaining = (frame.quantize(colors=64) for frame in frames)
    duration_ms = 1000 * _GIF_EVERY // SAMPLE_RATE_HZ
    first.save(path, save_all=True, append_images=remaining, duration=duration_ms, loop=0)


def _write_mp4(frames: Iterator["Image"], path: Path) -> None:
    import av

    codec = next(name for name in _CODECS if name in av.codecs_available)
    with av.open(str(path), mode="w") as container:
        stream = container.add_stream(codec, rate=Fraction(SAMPLE_RATE_HZ))
        stream.width, stream.height = _SIZE
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(np.asarray(frame), format="rgb24")
            for packet in stream.encode(picture):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
