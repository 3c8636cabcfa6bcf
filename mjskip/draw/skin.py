"""The water as it is drawn: a MuJoCo skin, fine near the stone and wide to the horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from mjskip._typing import Array
from mjskip.draw._draw_kernels import box_means, fill_skin
from mjskip.draw.surface import Surface

VERTICES = 125 * 125
"""Most vertices drawn: more are smaller than a pixel at 640 x 480 and cost their share."""

_HORIZON = 250.0  # [m]: at eye height of a metre the last of it is a fraction of a pixel high
_OUTER = 14  # vertices a side from the edge of what is looked at to the horizon
_ANCHOR = "mjskip water"


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Distances of the drawn vertices from the point of interest, along x and along y.

    Attributes:
        x: (vx,) ascending [m].
        y: (vy,) ascending [m].
        step: of the even part in the middle [m]; the grid moves by whole steps, so that vertices
            near the point of interest stay where they are and do not flicker.
    """

    x: Array
    y: Array
    step: float

    @classmethod
    def around(cls, *, step: float, shape: tuple[int, int] = (125, 125)) -> Grid:
        """Even in the middle, then slowly coarser, then leaping to the horizon.

        Args:
            step: of the even part [m].
            shape: vertices along x and y, odd and at least 41.

        Raises:
            ValueError: the shape is too small, even, or above the limit of vertices.
        """
        if min(shape) < 41 or any(n % 2 == 0 for n in shape) or shape[0] * shape[1] > VERTICES:
            raise ValueError(
                f"shape is {shape!r}: give two odd numbers of at least 41, their product at most "
                f"{VERTICES}"
            )
        return cls(x=_graded(shape[0], step), y=_graded(shape[1], step), step=step)


def _graded(count: int, step: float) -> Array:
    """Symmetric distances (count,) [m]: a third even, then 6 % wider each, a few to the horizon."""
    inner = (count - 1) // 2 - _OUTER
    even = inner // 3
    growth = 1.06 ** np.maximum(np.arange(inner) - even, 0.0)
    near = np.cumsum(step * growth)
    ratio = (_HORIZON / near[-1]) ** (1.0 / _OUTER)
    far = near[-1] * ratio ** np.arange(1, _OUTER + 1)
    side = np.concatenate([near, far])
    return np.concatenate([-side[::-1], [0.0], side])


def add_water(spec: Any, grid: Grid, *, material: str = "water") -> None:
    """Add the skin to a model under construction (`mujoco.MjSpec`); a missing material is made."""
    if spec.material(material) is None:
        spec.add_material(name=material, rgba=[0.06, 0.32, 0.45, 1.0], specular=1.0, shininess=1.0)
    spec.worldbody.add_body(name=_ANCHOR)
    nx, ny = len(grid.x), len(grid.y)
    count = nx * ny
    index = np.arange(count, dtype=np.int32).reshape(nx, ny)
    corners = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    a, b, c, d = (corner.ravel() for corner in corners)
    vertices = np.zeros((count, 3), dtype=np.float32)
    vertices[:, 0] = np.repeat(grid.x, ny)
    vertices[:, 1] = np.tile(grid.y, nx)
    skin = spec.add_skin(name=_ANCHOR, material=material)
    skin.vert = vertices.ravel()
    skin.face = np.column_stack([a, b, c, a, c, d]).astype(np.int32).ravel()
    skin.bodyname = [_ANCHOR]
    skin.bindpos = [0.0, 0.0, 0.0]
    skin.bindquat = [1.0, 0.0, 0.0, 0.0]
    skin.vertid = [np.arange(count, dtype=np.int32)]
    skin.vertweight = [np.ones(count, dtype=np.float32)]


class WaterSkin:
    """Writes a surface into the skin of a scene that `add_water` prepared."""

    def __init__(self, model: Any, grid: Grid) -> None:
        skin = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SKIN, _ANCHOR)
        first = int(model.skin_vertadr[skin])
        self._grid = grid
        self._rows = slice(first, first + len(grid.x) * len(grid.y))
        shape = (len(grid.x), len(grid.y))
        self._height, self._x_slope, self._y_slope = (np.empty(shape) for _ in range(3))
        self._scratch = np.empty((2, 0))

    def draw(self, scene: Any, surface: Surface, *, focus: tuple[float, float]) -> None:
        """Put the water around the point `focus` (x, y) [m] into an `mujoco.MjvScene`.

        Call it after the scene was updated, which resets its skins.
        """
        grid = self._grid
        nx, ny = surface.elevation.shape
        if self._scratch.shape[1] != ny:
            self._scratch = np.empty((2, ny))
        x, y = (
            grid.step * round((at - middle) / grid.step) + middle + axis
            for at, middle, axis in zip(focus, surface.centre, (grid.x, grid.y), strict=True)
        )
        box_means(
            surface.elevation,
            surface.spacing,
            _boxes(x, surface.centre[0], surface.spacing, nx),
            _boxes(y, surface.centre[1], surface.spacing, ny),
            self._scratch[0],
            self._scratch[1],
            self._height,
            self._x_slope,
            self._y_slope,
        )
        fill_skin(
            x,
            y,
            self._height,
            self._x_slope,
            self._y_slope,
            scene.skinvert.reshape(-1, 3)[self._rows],
            scene.skinnormal.reshape(-1, 3)[self._rows],
        )


def _boxes(axis: Array, centre: float, spacing: float, count: int) -> Array:
    """Borders (n, 2) of the boxes that vertices on an axis stand for, in cells from the edge.

    They reach from neighbour to neighbour, each point being in two of them: what is shaded then
    bends over two vertices at least, and triangles do not show.
    """
    ends = [2.0 * axis[0] - axis[1]], [2.0 * axis[-1] - axis[-2]]
    around = np.concatenate([ends[0], axis, ends[1]])
    borders = np.column_stack([around[:-2], around[2:]])
    return np.asarray((borders - centre) / spacing + 0.5 * count)
