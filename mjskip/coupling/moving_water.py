"""Water that moves, as the keys of the plugin describe it; and what its compiled code is given."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cache
from typing import Literal, get_args

import numpy as np
from numba import types

from mjskip._compile.jit import native
from mjskip._compile.pointers import address_of_cfunc
from mjskip._typing import Array
from mjskip.checks import check_choice, check_number, check_positive
from mjskip.hydro import _block as hydro
from mjskip.waves.coupling import (
    LOAD_RADIUS,
    PROFILE_PER_RADIUS_SQUARED,
    deep_profile,
    split_block,
    wave_profile,
)

SurfaceKind = Literal["still", "waves", "deep"]
SURFACES: tuple[SurfaceKind, ...] = get_args(SurfaceKind)

MIN_CELLS, MAX_CELLS = 16, 512
"""Along a side of a window: its state is 3 doubles a cell."""

LONGEST_FACE = 2.0
"""Longest edge of a face inside MuJoCo, in radii of a bump: a third of the faces of the reference engine, which has 1;
times of touches and exit speeds of the throws of docs/water.md change by 1 to 1.5%."""

MAX_FACES = 1024
"""Faces of a body, after splitting: a step solves for all that are loaded at once."""


@dataclass(frozen=True, kw_only=True)
class MovingWater:
    """The surface of an instance.

    Attributes:
        surface: "still", "waves" (equation 5) or "deep" (real waves).
        size: width of the square of water that moves [m].
        spacing: of its cells [m].
        depth: of "deep" [m].
        wave_speed: of "waves" [m/s].
        damping: mu of equation (5) [1/s].
        tension: surface tension of "deep" [N/m].
        load_radius: of the bumps that spread the load of a face [m]; a cell at least.
        arrows: length of force arrows in viewers [m/N]; 0 for none.
    """

    surface: SurfaceKind = "still"
    size: float = 0.64
    spacing: float = 0.01
    depth: float = math.inf
    wave_speed: float = 1.0
    damping: float = 0.0
    tension: float = 0.0
    load_radius: float = LOAD_RADIUS
    arrows: float = 0.0

    def __post_init__(self) -> None:
        check_choice("surface", self.surface, SURFACES)
        check_number("arrows", self.arrows, low=0.0, unit="m/N")
        if not self.moves:
            given = [
                f.name
                for f in fields(self)
                if f.name not in ("surface", "arrows") and getattr(self, f.name) != f.default
            ]
            if given:
                raise ValueError(
                    f"{given[0]} is given and the surface is still: leave it out, or set surface to waves or deep"
                )
            return
        check_positive(size=self.size, spacing=self.spacing)
        if not MIN_CELLS <= self.cells <= MAX_CELLS:
            raise ValueError(
                f"size is {self.size:g} and spacing {self.spacing:g}: give {MIN_CELLS} to {MAX_CELLS} cells along a "
                "side"
            )
        self._water(density=1000.0, gravity=9.81)
        if not self.load_radius >= self.spacing:
            raise ValueError(
                f"load_radius is {self.load_radius:g} and spacing {self.spacing:g}: give a radius of a cell at least"
            )

    @property
    def moves(self) -> bool:
        """Whether it is anything but still water."""
        return self.surface != "still"

    @property
    def cells(self) -> int:
        """Along a side."""
        return round(self.size / self.spacing) if self.moves and self.spacing > 0.0 else 0

    @property
    def state_size(self) -> int:
        """Doubles that it keeps in MjData."""
        from mjskip.coupling import _moving_kernels as kernels

        return int(kernels.state_size.py_func(self.cells)) if self.moves else 0  # type: ignore[attr-defined]

    def _water(self, *, density: float, gravity: float) -> Array:
        from mjskip.waves.window import water_of  # its transforms take as long to import as MuJoCo

        assert self.surface != "still"
        return water_of(
            self.surface, cells=max(self.cells, MIN_CELLS), spacing=self.spacing, gravity=gravity,
            density=density, wave_speed=self.wave_speed, depth=self.depth, damping=self.damping,
            tension=self.tension,
        )  # fmt: skip

    def record(self, *, density: float, gravity: float) -> Array:
        """What `_moving_kernels` knows the surface by."""
        from mjskip.coupling import _moving_kernels as kernels
        from mjskip.waves._window_kernels import STENCIL
        from mjskip.waves.window import largest_timestep

        head = np.zeros(kernels.SURFACE)
        head[kernels.ARROWS] = self.arrows
        if not self.moves:
            return head
        if not gravity > 0.0:
            raise ValueError(
                f"gravity is {gravity:g} m/s^2 downwards: water that moves needs gravity along -z; set surface to still"
            )
        water = self._water(density=density, gravity=gravity)
        radius = self.load_radius
        if water[STENCIL] > 0.0:
            profile = _wave_profile(self.wave_speed, gravity, radius)
        else:
            profile = _deep_profile(radius, self.depth)
        head[kernels.WATER_SIZE], head[kernels.PROFILE_SIZE] = len(water), len(profile)
        head[kernels.STATE_DOUBLES], head[kernels.LOAD_RADIUS] = self.state_size, radius
        head[kernels.PER_AREA] = PROFILE_PER_RADIUS_SQUARED / radius**2
        head[kernels.MAX_TIMESTEP] = largest_timestep(water)
        return np.concatenate([head, water, profile])

    def split(self, block: Array) -> tuple[Array, Array]:
        """A body's block for the coupling, and the block of what the coupling leaves alone.

        Raises:
            ValueError: the body has too many faces for this radius.
        """
        split = split_block(block, LONGEST_FACE * self.load_radius)
        count = int(split[hydro.N_FACES])
        if count > MAX_FACES:
            raise ValueError(
                f"load_radius is {self.load_radius:g} m, and a body of radius {block[hydro.RADIUS]:.3g} m has {count} "
                f"faces no longer than twice that, of {MAX_FACES} at most: use a larger load_radius"
            )
        rest = block.copy()
        rest[[hydro.NORMAL_SQUARED, hydro.SPEED_NORMAL, hydro.CAVITY]] = 0.0
        return split, rest


@cache
def _deep_profile(radius: float, depth: float) -> Array:
    return deep_profile(radius=radius, depth=depth)


@cache
def _wave_profile(wave_speed: float, gravity: float, radius: float) -> Array:
    return wave_profile(wave_speed=wave_speed, gravity=gravity, radius=radius)


@cache
def moving_functions() -> tuple[int, int, int]:
    """Addresses of what computes, advances and draws moving water: compiled when first needed."""
    from mjskip.coupling import _moving_drawing_kernels as drawing
    from mjskip.coupling import _moving_kernels as kernels

    signature = types.void(types.int64, types.int64, types.int64)
    compiled = [
        native(signature)(function)
        for function in (kernels.moving_compute, kernels.moving_advance, drawing.moving_draw)
    ]
    _alive.extend(compiled)
    compute, advance, draw = map(address_of_cfunc, compiled)
    return compute, advance, draw


_alive: list[object] = []
"""MuJoCo may call them as long as the process lives."""
