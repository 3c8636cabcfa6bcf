"""Forces to see: arrows of water and air, wetted faces, the centre of buoyancy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from mjskip._typing import Array, Image
from mjskip.draw.eye import PinholeCamera
from mjskip.hydro.hydrostatics import clipped, hydrostatics
from mjskip.hydro.stone import Stone
from mjskip.rigid.attitude import matrices
from mjskip.throws.trajectory import Trajectory, pose_at

ARROW_LENGTH = 0.3
"""Of an arrow, that of the greatest force of the water in a flight [m]."""

WATER, AIR, BUOYANCY, WETTED = (70, 160, 255), (250, 250, 250), (255, 220, 60), (255, 120, 60)
"""Colours, red, green and blue."""

_WIDTH = 0.008  # [m] of an arrow


@dataclass(frozen=True, kw_only=True, eq=False)
class Loads:
    """What acts on a body at a moment.

    Attributes:
        arrows: (start (3,) [m], tip (3,) [m], colour) of each force.
        faces: wetted parts of the body's faces (n, 3, 3), world [m].
        buoyancy: its centre (3,) [m]; None if the body is dry.
        text: the forces as a line.
    """

    arrows: list[tuple[Array, Array, tuple[int, int, int]]]
    faces: Array
    buoyancy: Array | None
    text: str


def loads_at(flight: Trajectory, stone: Stone, time: float) -> Loads:
    """Of a recorded flight, at a time [s]; the surface about the body is taken to be level."""
    row = min(
        max(int(np.searchsorted(flight.time, time, side="right")) - 1, 0), len(flight.time) - 1
    )
    position, attitude = pose_at(flight, time)
    corners = position + stone.vertices @ matrices(attitude[None])[0].T
    # the lowest point is so far above the water: where that is not at 0, neither is the surface
    level = float(corners[:, 2].min() - flight.clearance[row])
    raised = corners[stone.faces] - [0.0, 0.0, level]
    faces = clipped(raised) + np.array([0.0, 0.0, level])
    scale = ARROW_LENGTH / max(float(np.linalg.norm(flight.force, axis=1).max()), 1e-9)
    arrows, words = [], []
    for name, force, start, colour in (
        ("water", flight.force[row], flight.wetted_centre[row], WATER),
        ("air", flight.air_force[row], position, AIR),
    ):
        size = float(np.linalg.norm(force))
        words.append(f"{name} {size:.3g} N")
        if size * scale > 0.003:  # a shorter one is a dot
            arrows.append((start, start + scale * force, colour))
    centre = None
    if len(faces):
        centre = hydrostatics(raised, centre_of_mass=position).centre_of_buoyancy
        centre = centre + np.array([0.0, 0.0, level])
    return Loads(arrows=arrows, faces=faces, buoyancy=centre, text="  ·  ".join(words))


def draw_loads(image: Image, loads: Loads, eye: PinholeCamera) -> None:
    """Draw them over a picture, in place: nothing hides them."""
    from PIL import Image as Pictures
    from PIL import ImageDraw

    high, wide, _ = image.shape
    layer = Pictures.new("RGBA", (2 * wide, 2 * high))  # twice as large: edges come out smooth
    pen = ImageDraw.Draw(layer)

    def pixels(points: Array) -> list[tuple[float, float]] | None:
        """Where points are seen; None if one is behind the camera or far out of sight."""
        place, ahead = eye.project(points)
        if (ahead < 0.02).any() or (np.abs(place) > 4.0).any():
            return None
        flat = np.column_stack([(place[:, 0] + 1.0) * wide, (1.0 - place[:, 1]) * high])
        return [(float(x), float(y)) for x, y in flat]

    for face in loads.faces:
        if corners := pixels(face):
            pen.polygon(corners, fill=(*WETTED, 90))
    for start, tip, colour in loads.arrows:
        if ends := pixels(np.stack([start, tip])):
            (x0, y0), (x1, y1) = ends
            along = np.array([x1 - x0, y1 - y0])
            size = float(np.linalg.norm(along))
            along /= max(size, 1e-9)
            head = min(0.35 * size, 0.05 * high)
            neck = np.array([x1, y1]) - head * along
            side = 0.45 * head * np.array([-along[1], along[0]])
            pen.line([(x0, y0), tuple(neck)], fill=(*colour, 235), width=max(3, high // 80))
            pen.polygon([(x1, y1), tuple(neck + side), tuple(neck - side)], fill=(*colour, 235))
    if loads.buoyancy is not None and (at := pixels(loads.buoyancy[None])):
        (x, y), r = at[0], 0.014 * high
        pen.ellipse((x - r, y - r, x + r, y + r), fill=(*BUOYANCY, 235), outline=(20, 20, 20, 235))
    small = np.asarray(layer.resize((wide, high), Pictures.Resampling.BOX), np.float32)
    cover = small[..., 3:] / 255.0
    image[:] = ((1.0 - cover) * image + cover * small[..., :3]).astype(np.uint8)


def add_loads(scene: Any, loads: Loads) -> None:
    """Add them to an `mujoco.MjvScene` as geoms, for a viewer."""
    for start, tip, colour in loads.arrows:
        _add(scene, mujoco.mjtGeom.mjGEOM_ARROW, colour, lambda geom, a=start, b=tip: mujoco.mjv_connector(
            geom, mujoco.mjtGeom.mjGEOM_ARROW, _WIDTH, a, b
        ))  # fmt: skip
    if loads.buoyancy is not None:
        geom = _add(scene, mujoco.mjtGeom.mjGEOM_SPHERE, BUOYANCY, None)
        if geom is not None:
            geom.pos[:], geom.size[:] = loads.buoyancy, 0.01


def _add(scene: Any, kind: Any, colour: tuple[int, int, int], shape: Any) -> Any:
    """One geom more, if there is room for it."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    rgba = np.array([*colour, 255], np.float32) / 255.0
    mujoco.mjv_initGeom(geom, int(kind), np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
    if shape is not None:
        shape(geom)
    scene.ngeom += 1
    return geom
