"""Which program of `water.glsl` draws which tile of a picture: each tile the cheapest that has what it needs."""

from __future__ import annotations

import math

import numpy as np

from mjskip._typing import Array, Flags, SingleArray
from mjskip.draw.passes import TILE
from mjskip.draw.surface import BLOCK

STILL = 5e-5
"""[m]: what is lower is drawn as still water."""

_BEND = 1.15  # tangent of the steepest a ray can be under water: 49 degrees
_BORDER = 2.0  # pixels: tiles know their neighbours' edges
_HORIZON = 1e4  # [m]


def footprints(view: SingleArray, size: tuple[int, int]) -> tuple[Flags, Flags, Array]:
    """Where tiles are on the water.

    Args:
        view: (rows, 4), `water.glsl`'s View.
        size: of the picture [pixels].

    Returns:
        Which tiles (rows, columns) hold any water, which hold nothing beyond it, and the box about what each
        holds of the plane z = 0, (rows, columns, 4): least and greatest x, least and greatest y [m].
    """
    eye, ahead, right, up = (view[k, :3].astype(np.float64) for k in range(4))
    flat, middle = float(view[1, 3]), float(view[2, 3])
    edges = []
    for side in size:
        first = np.arange(-(-side // TILE)) * TILE
        edges.append(2.0 * np.stack([first - _BORDER, first + TILE + _BORDER]) / side - 1.0)
    across = (edges[0][:, :, None] - middle) * right  # (2, columns, 3)
    along = edges[1][:, :, None] * up  # (2, rows, 3)
    offset = along[:, None, :, None] + across[None, :, None, :]  # (2, 2, rows, columns, 3)
    ray = ahead + (1.0 - flat) * offset
    start = eye + flat * offset
    dips = ray[..., 2] * view[0, 3] < -1e-6
    far = np.where(dips, -start[..., 2] / np.where(dips, ray[..., 2], 1.0), _HORIZON)
    places = (start + far[..., None] * ray)[..., :2].reshape(4, *dips.shape[2:], 2)
    box = np.stack([places.min(axis=0), places.max(axis=0)], axis=-1)
    return dips.any(axis=(0, 1)), dips.all(axis=(0, 1)), box.reshape(*box.shape[:2], 4)


def overlap(boxes: Array, others: Array) -> Flags:
    """Which boxes (rows, columns, 4) touch any of the others (n, 4)."""
    if not len(others):
        return np.zeros(boxes.shape[:2], np.bool_)
    a, b = boxes[:, :, None, :], others
    touch = (
        (a[..., 0] < b[:, 1])
        & (a[..., 1] > b[:, 0])
        & (a[..., 2] < b[:, 3])
        & (a[..., 3] > b[:, 2])
    )
    return np.asarray(touch.any(axis=-1))


def rough(boxes: Array, tall: SingleArray, corner: Array, spacing: float, depth: float) -> Flags:
    """Which boxes have waves in them, or near enough to cast light on what is seen through them.

    Args:
        boxes: (rows, columns, 4) [m].
        tall: (n, m) greatest height or depth in blocks of cells [m].
        corner: outer edge of the first block (2,) [m].
        spacing: side of a cell [m].
        depth: of the water [m].
    """
    side = BLOCK * spacing
    counts = np.zeros((tall.shape[0] + 1, tall.shape[1] + 1), np.int64)
    np.cumsum(np.cumsum(tall > STILL, axis=0), axis=1, out=counts[1:, 1:])
    if not counts[-1, -1]:
        return np.zeros(boxes.shape[:2], np.bool_)
    wider = min(_BEND * depth, 4.0 * side)
    first, last = [], []
    for axis, most in enumerate(tall.shape):
        low = np.floor((boxes[..., 2 * axis] - wider - corner[axis]) / side)
        high = np.ceil((boxes[..., 2 * axis + 1] + wider - corner[axis]) / side)
        first.append(np.clip(low, 0, most).astype(np.intp))
        last.append(np.clip(high, 0, most).astype(np.intp))
    (i, j), (k, n) = first, last
    return np.asarray(counts[k, n] - counts[i, n] - counts[k, j] + counts[i, j] > 0)


def around_bodies(
    eye: Array, sun: Array, bodies: Array, depth: float
) -> tuple[Array, Array, Array]:
    """Boxes (n, 4) on the water where bodies are mirrored, are seen through it, and cast shadows.

    Args:
        eye: (3,) [m].
        sun: unit, towards it (3,).
        bodies: (n, 4) centres and radii [m].
        depth: of the water [m].
    """
    centre, radius, height = bodies[:, :2], 1.3 * bodies[:, 3:], bodies[:, 2:3]
    above, under = np.maximum(height, 0.0), np.maximum(radius - height, 0.0)
    cast = centre - above * sun[:2] / sun[2]  # its shadow on the surface, and on the bottom
    sunk = cast - depth * sun[:2] / math.sqrt(0.777 + sun[2] ** 2)
    share = eye[2] / (eye[2] + above)  # of the way to the image, to the surface
    mirrored = eye[:2] + (centre - eye[:2]) * share
    flat = np.linalg.norm(centre - eye[:2], axis=1, keepdims=True) / (eye[2] + above)

    def box(place: Array, size: Array, below: Array | float = 0.0) -> Array:
        """What is under water is seen through the surface between it and the eye.

        The angle there is between those to the place itself and to the surface over it.
        """
        toward = eye[:2] - place
        away = np.linalg.norm(toward, axis=1, keepdims=True)
        ends = []
        for rise in (eye[2], eye[2] + below):
            sine = away / np.hypot(away, rise) / 1.333
            step = below * sine / np.sqrt(1.0 - sine**2) / np.maximum(away, 1e-9)
            ends += [place + step * toward - size, place + step * toward + size]
        least, most = np.min(ends, axis=0), np.max(ends, axis=0)
        return np.stack([least[:, 0], most[:, 0], least[:, 1], most[:, 1]], axis=1)

    return (
        box(mirrored, 1.3 * radius * share * np.hypot(1.0, flat)),  # waves make it larger
        box(centre, radius, under)[under[:, 0] > 0.0],
        np.concatenate([box(cast, radius), box(sunk, 1.5 * radius, depth)]),
    )


def hidden_by(eye: Array, low: Array, high: Array) -> Array:
    """Boxes (n, 4) on the water that boxes in the air hide from an eye above it.

    Args:
        eye: (3,) [m].
        low: least x, y, z of each (n, 3) [m].
        high: greatest (n, 3) [m].
    """
    found = []
    for x in (low[:, 0], high[:, 0]):
        for y in (low[:, 1], high[:, 1]):
            for z in (np.zeros(len(low)), high[:, 2]):
                drop = np.maximum(
                    eye[2] - z, 1e-3 * eye[2]
                )  # what is above the eye hides all beyond
                stretch = np.minimum(eye[2] / drop, _HORIZON)
                found.append([eye[0] + (x - eye[0]) * stretch, eye[1] + (y - eye[1]) * stretch])
    places = np.array(found)  # (8, 2, n)
    least, most = places.min(axis=0), places.max(axis=0)
    return np.stack([least[0], most[0], least[1], most[1]], axis=1)


def under_water(size: tuple[int, int]) -> dict[str, Flags]:
    """Tiles of a picture [pixels] by the programs that draw them for an eye under water."""
    every = np.ones((-(-size[1] // TILE), -(-size[0] // TILE)), np.bool_)
    return {"LIGHT WAVES SHADE MIRROR DIVE SUNK": every, "PICTURE STANDING SUNK": every}


def programs(
    water: Flags, whole: Flags, hidden: Flags, waves: Flags, standing: Flags,
    mirror: Flags, dive: Flags, shade: Flags,
) -> dict[str, Flags]:  # fmt: skip
    """Tiles by the programs that draw them, in the order of drawing.

    Args:
        water: holds some.
        whole: nothing but water and geoms in it, no horizon.
        hidden: may hold geoms before the water.
        waves: may hold waves.
        standing: may hold what stands in the water.
        mirror: may hold images of bodies that move.
        dive: may hold bodies that move under water.
        shade: may hold shadows.
    """
    found: dict[str, Flags] = {}
    rest = water
    for kind, needed in (
        ("WAVES STANDING SHADE MIRROR DIVE", dive),
        ("WAVES STANDING SHADE MIRROR", mirror),
        ("WAVES STANDING SHADE", shade & standing),
        ("WAVES SHADE", shade),
        ("WAVES STANDING", standing),
        ("WAVES", waves),
        ("", water),
    ):
        found[f"LIGHT {kind}".strip()] = rest & needed
        rest = rest & ~needed
    sure = water & whole & ~standing & ~hidden & ~dive
    exact = standing | mirror | dive
    rest = water & ~sure
    pictures = {
        "COPY": ~water,
        "SURE": sure,
        "PICTURE": rest & ~exact,
        "PICTURE STANDING": rest & exact,
    }
    return found | pictures
