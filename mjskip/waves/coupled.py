"""Bodies on moving water: they feel one surface, press on it, and both move on step by step together."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from mjskip._typing import Array, Integers
from mjskip.checks import check_memory
from mjskip.errors import DivergedError, MjskipWarning
from mjskip.hydro import _block as hydro
from mjskip.hydro.columns import LOAD, WRENCH
from mjskip.hydro.packing import triangles_of
from mjskip.hydro.wrench import immersion_address
from mjskip.rigid.state import STATE
from mjskip.waves import _coupled_arrays as arrays
from mjskip.waves import _coupled_kernels as kernels
from mjskip.waves._coupled_arrays import Coupled
from mjskip.waves._coupled_loads import MARGIN
from mjskip.waves._face_kernels import FACE, MOBILITY
from mjskip.waves._stencil import SAFE_FRACTION
from mjskip.waves.coupling import LOAD_RADIUS, TOLERANCE, split_block, wave_impulse
from mjskip.waves.field import HeightField
from mjskip.waves.recording import SurfaceRecorder

NEAR_CLEARANCE = 0.02
"""Clearance above the waves (taken as twice as high as when last measured) at which a body is near [m]."""

WAIT_AFTER = 0.010
"""Dry time after which the surface waits for the next body that comes near [s]."""

LOOSE_TOLERANCE = 1e-4
"""Of the loads in the last sweep, relative to the greatest, where another integrator errs by more: a sweep leaves
about a seventh of the error that it found."""

STEPS_BETWEEN_CHECKS = 16
"""Most steps between looks for calm tiles and for those that waves reach; a wave moves half a cell at most."""

LONGEST_FACE = 1.3
"""Longest edge of a face, in load radii; longer ones are split. Times and exit speeds of a touch are within 0.5% and
1.7% of those with ever shorter faces; at 1 it takes twice as many faces and they are within 0.2% and 1.1%."""

MANY_CELLS = 400
"""Cells across the surface under a body beyond which a step takes longer than the water around it."""


class Stepper(Protocol):
    """What moves the bodies: a C function void(context, states after the step, unused), and its context."""

    @property
    def step(self) -> int: ...
    @property
    def context(self) -> Array: ...


class CoupledWater:
    """n bodies and the surface that they share; the surface waits behind the time while nobody is near it.

    Attributes:
        field: the water, up to date after `catch_up`.
        coupled: bodies and the blocks of surface under them, for kernels.
        words: where those arrays are, for C functions: see `_coupled_arrays.coupled_at`.
    """

    def __init__(
        self,
        field: HeightField,
        blocks: Sequence[Array],
        *,
        timestep: float,
        density: float = 1000.0,
        gravity: float = 9.81,
        stages: int,
        load_radius: float = LOAD_RADIUS,
        recorder: SurfaceRecorder | None = None,
    ) -> None:
        """Put bodies on water.

        Args:
            field: the water: between walls, periodic or endless, with the nine-point stencil.
            blocks: of the bodies, see `mjskip.hydro.wrench.pack`; copied.
            timestep: of bodies and water [s].
            density: of the water [kg/m^3].
            gravity: [m/s^2].
            stages: evaluations that the engine makes in a step, 4 for RK4; 0 if it is `kick_step`.
            load_radius: of the bumps that spread a face's load and sample the surface under it [m].
            recorder: keeps the surface.

        Raises:
            ValueError: the water or the step cannot be coupled.
        """
        check_water(field, timestep, gravity)
        self.field, self._recorder, self._timestep = field, recorder, timestep
        self._immersion = immersion_address()
        self._waiting, self._behind = True, 0.0
        self._patience = SAFE_FRACTION * field.max_timestep
        self._general = np.zeros(0, np.float32)
        if not load_radius >= field.spacing:
            raise ValueError(
                f"load_radius is {load_radius:g} m and cells are {field.spacing:g} m wide: give a radius of a cell at "
                "least"
            )
        side = math.floor(2.0 * load_radius / field.spacing) + 1
        impulse = wave_impulse(wave_speed=field.wave_speed, gravity=gravity, spacing=field.spacing)
        self.coupled = _arrays(blocks, load_radius, side, impulse)
        numbers, grid = self.coupled.numbers, field.grid
        x, y = field.cell_position(0, 0)
        q, s = grid.coefficients(timestep)
        edge, corner = grid.weights(timestep)
        for name, value in (
            (arrays.TIMESTEP, timestep),
            (arrays.SPACING, field.spacing),
            (arrays.ORIGIN_X, x),
            (arrays.ORIGIN_Y, y),
            (arrays.RADIUS, load_radius),
            (arrays.TOLERANCE, TOLERANCE if stages == 0 else LOOSE_TOLERANCE),
            (
                arrays.FACTOR,
                timestep
                / (2.0 * density * field.spacing**2 * (1.0 + 0.5 * field.damping * timestep)),
            ),
            (arrays.NEAR, NEAR_CLEARANCE),
            (arrays.HEAD, 1.0 / (density * gravity * field.spacing**2)),
            (arrays.Q, q),
            (arrays.S, s),
            (arrays.EDGE, edge),
            (arrays.CORNER, corner),
            (arrays.AMPLITUDE, field.sleep_amplitude),
            (arrays.WAIT_AFTER, WAIT_AFTER),
            (arrays.AHEAD, 0.5 * timestep if stages else -1.0),
        ):
            numbers[name] = value
        numbers[arrays.HIGHEST] = field.highest
        self.coupled.counts[arrays.STAGES] = stages
        self.coupled.counts[arrays.SIDE] = side
        courant = field.wave_speed * timestep / field.spacing
        self.coupled.counts[arrays.BETWEEN_CHECKS] = min(STEPS_BETWEEN_CHECKS, max(1, int(0.5 / courant)))  # fmt: skip
        self.coupled.counts[arrays.GENERAL] = grid.is_general
        self._general = grid.general_numbers(q, s, timestep)
        self.words = np.empty(3 * len(self.coupled), np.int64)
        self._allocate_cells(blocks)

    def advance(self, engine: Stepper, states: Array, steps: int) -> tuple[Array, Array, Array]:
        """Move bodies and water on.

        Args:
            engine: what steps the bodies.
            states: of the bodies (n, 18).
            steps: how many.

        Returns:
            States (steps + 1, n, 18), beginning with those given, loads (steps, n, 17) at the beginning of each
            step, and the vertical force that the water was given over it (steps, n), downwards [N].

        Raises:
            DivergedError: a force is not finite.
        """
        n = len(states)
        path, loads, reactions = np.empty((steps + 1, n, STATE)), np.zeros((steps, n, LOAD)), np.zeros((steps, n))  # fmt: skip
        path[0] = states
        done = 0
        while done < steps:
            self._record()
            most = min(steps - done, self._most_steps())
            made, why = kernels.coupled_steps(
                engine.step, engine.context, self._immersion, self.coupled, self.field.grid.tiles,
                self.field.grid.medium, self._general, self._waiting, path[done : done + most + 1],
                loads[done : done + most], reactions[done : done + most],
            )  # fmt: skip
            self._passed(made)
            done += made
            self._check_finite()
            self._answer(why)
        return path, loads, reactions

    def catch_up(self) -> None:
        """Bring the field to the present."""
        if self._behind > 0.0:
            self.field.advance(self._behind)
            self._behind = 0.0
            self.coupled.numbers[arrays.HIGHEST] = self.field.highest

    def finish(self) -> None:
        """After the last step: let the recorder follow the rings as long as it wants to."""
        self.catch_up()
        if self._recorder is not None:
            self._recorder.linger(self.field)

    def _passed(self, steps: int) -> None:
        if self._waiting:
            self._behind += steps * self._timestep
        else:
            self.field.time += steps * self._timestep

    def _record(self) -> None:
        now = self.field.time + self._behind
        if self._recorder is not None and self._recorder.is_due(now):
            self.catch_up()
            self._recorder.record(self.field)

    def _most_steps(self) -> int:
        """Steps until the surface cannot wait any longer, or is recorded."""
        most = 1 << 30
        if self._waiting:
            if self._behind + self._timestep > self._patience:
                self.catch_up()
            most = max(1, int((self._patience - self._behind) / self._timestep * (1.0 + 1e-12)))
        if self._recorder is not None:
            most = min(most, self._recorder.steps_until_due(self.field.time + self._behind))
        return most

    def _answer(self, why: int) -> None:
        """Do what the kernel cannot."""
        grid, counts = self.field.grid, self.coupled.counts
        if why == kernels.SURFACE:
            self.catch_up()
            grid.retime(self._timestep)
            self._waiting = False
            counts[arrays.DRY_STEPS] = counts[arrays.STEPS] = 0
        elif why == kernels.CALM:
            self._waiting = True
        elif why == kernels.ROOM:
            grid.make_room()
            grid.activate_called()
        elif why == kernels.CALLED:
            grid.survey()
        elif why == kernels.CELLS:
            self._make_cells(4 * len(self.coupled.heads))

    def _check_finite(self) -> None:
        failed = int(self.coupled.counts[arrays.FAILED])
        if failed:
            when = self.field.time + self._behind
            raise DivergedError(
                f"the water's force on body {failed - 1} is not finite at t = {when:.6g} s: use a smaller time step",
                time=when,
            )

    # Room ---------------------------------------------------------------------------------------

    def _allocate_cells(self, blocks: Sequence[Array]) -> None:
        """Cells for all bodies, each by itself."""
        d, cells = self.field.spacing, 0
        for block in blocks:
            radius = float(block[hydro.RADIUS])
            side = 2 * int(np.ceil(radius / d)) + 1
            if side > MANY_CELLS:
                warnings.warn(
                    f"a body of {radius:g} m covers {side} x {side} cells of {d:g} m, and {len(self.coupled.faces)} "
                    "faces are solved with them: that is slow; a larger spacing and load_radius would do",
                    MjskipWarning,
                    stacklevel=3,
                )
            reach = radius + float(self.coupled.numbers[arrays.RADIUS])
            cells += (2 * int(np.ceil(reach / d)) + 2 * MARGIN + 5) ** 2
        self._make_cells(cells)

    def _make_cells(self, cells: int) -> None:
        """Arrays for so many cells of surface under the bodies."""
        size = 8 * 9 * cells
        check_memory(
            f"the surface of {cells} cells of {self.field.spacing:g} m under the bodies",
            size,
            "use a larger spacing",
        )
        n = len(self.coupled.clusters)
        self.coupled = self.coupled._replace(
            patches=np.zeros(hydro.PATCH_POINTS * n + 2 * cells),
            heads=np.zeros(cells),
            open_cells=np.zeros(cells),
            field=np.zeros(cells),
            wide=np.zeros(4 * cells),
        )
        for k, array in enumerate(self.coupled):
            shape = (*array.shape, 0)[:2]
            self.words[3 * k : 3 * k + 3] = array.ctypes.data, *shape


def check_water(field: HeightField, timestep: float, gravity: float) -> None:
    """Refuse water that bodies cannot be coupled to.

    Raises:
        ValueError: what is wrong.
    """
    if not gravity > 0.0:
        raise ValueError(
            f"gravity is {-gravity:g} m/s^2 along z: waves need water that is held down; give a negative number, or "
            "still water"
        )
    if field.stencil != "nine_point":
        raise ValueError(f"stencil is {field.stencil!r}: bodies move nine_point water only")
    if field.boundary == "absorb":
        raise ValueError("bodies move no absorbing field: use HeightField.endless()")
    if timestep > field.max_timestep:
        raise ValueError(
            f"time step {timestep:g} s is too long for the waves: use at most {field.max_timestep:.3g} s, or a "
            "larger spacing"
        )


def _arrays(blocks: Sequence[Array], radius: float, side: int, impulse: Array) -> Coupled:
    """Arrays for bodies; those for cells are still empty."""
    n = len(blocks)
    rest = [block.copy() for block in blocks]
    law = [
        hydro.NORMAL_SQUARED,
        hydro.SPEED_NORMAL,
        hydro.SPEED_SQUARED,
        hydro.FRICTION,
        hydro.CAVITY,
    ]
    for block in rest:
        block[law] = 0.0
        if not (block[hydro.WEIGHT_DENSITY] or block[hydro.SKIN_DENSITY]):
            block[[hydro.N_FACES, hydro.STRIDE]] = 0  # the air needs none
    split = [split_block(block, LONGEST_FACE * radius) for block in blocks]
    triangles = [triangles_of(block) for block in split]
    meshes = [_shared_vertices(corners) for corners in triangles]
    vectors = [0.5 * np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in triangles]
    panels = [
        np.column_stack(
            [v / np.linalg.norm(v, axis=1)[:, None], t.mean(axis=1), np.linalg.norm(v, axis=1)]
        )
        for v, t in zip(vectors, triangles, strict=True)
    ]
    nothing = np.zeros(0)
    return Coupled(
        own=np.concatenate(blocks),
        own_starts=_starts(blocks),
        rest=np.concatenate(rest),
        rest_starts=_starts(rest),
        split=np.concatenate(split),
        split_starts=_starts(split),
        vertices=np.concatenate([vertices for vertices, _ in meshes]),
        vertex_starts=_starts([vertices for vertices, _ in meshes]),
        corners=np.concatenate([corners for _, corners in meshes]),
        panels=np.concatenate(panels),
        face_starts=_starts(panels),
        states=np.zeros((n, STATE)),
        poses=np.zeros((n, STATE)),
        means=np.zeros((n, STATE)),
        mobilities=np.zeros((n, MOBILITY)),
        wrenches=np.zeros((n, WRENCH)),
        first=np.zeros((n, WRENCH)),
        reactions=np.zeros(n),
        clusters=np.full(n, -1, np.int64),
        boxes=np.zeros((n, arrays.BOX), np.int64),
        fastest=np.zeros(n),
        patches=nothing,
        heads=nothing,
        open_cells=nothing,
        field=nothing,
        wide=nothing,
        faces=np.zeros((sum(map(len, panels)), FACE + side**2 + (side + 2) ** 2)),
        guesses=np.zeros(sum(map(len, panels))),
        heights=np.zeros(max(len(vertices) for vertices, _ in meshes)),
        turns=np.zeros((n, 6)),
        impulse=impulse,
        numbers=np.zeros(arrays.NUMBERS),
        counts=np.zeros(arrays.COUNTS, np.int64),
    )


def _shared_vertices(triangles: Array) -> tuple[Array, Integers]:
    """Vertices (v, 3) and the corners (f, 3) of triangles (f, 3, 3) among them."""
    vertices, corners = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, corners.reshape(-1, 3).astype(np.int64)


def _starts(parts: Sequence[Array]) -> Integers:
    return np.cumsum([0, *(len(part) for part in parts)]).astype(np.int64)
