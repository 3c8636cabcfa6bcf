"""A step of n bodies and their water in compiled code: look at the surface, force, engine step, surface step.

    level z[n], rate (z_free[n+1] - z[n-1]) / (2 dt)      on a block of cells under the bodies
    wet faces                                              where the bodies will be in the middle of the step
    loads f of the law, solved with the surface            at the velocities as they are (`_face_kernels`)
    engine step                                            later evaluations: the law at their velocities
    z[n+1] = z_free[n+1] + response to the loads           weighted as the engine weights its evaluations

The engine is a C function void(context, states, unused) that makes a step and writes the states (n, 18) after
it. On its way it lets `add_loads` find the loads, as often as it evaluates forces.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, call_address
from mjskip.hydro import _block as hydro
from mjskip.hydro.columns import CLEARANCE, WRENCH
from mjskip.waves import _face_kernels as faces
from mjskip.waves._block_kernels import highest_in, press_block
from mjskip.waves._coupled_arrays import (
    AHEAD,
    AMPLITUDE,
    BETWEEN_CHECKS,
    CLUSTERS,
    CORNER,
    DRY_STEPS,
    EDGE,
    FAILED,
    FIRST,
    GENERAL,
    HEAD,
    HIGHEST,
    I0,
    J0,
    LAST,
    NEAR,
    NX0,
    NY0,
    ORIGIN_X,
    ORIGIN_Y,
    SIDE,
    SPACING,
    STAGE,
    STEPS,
    TIMESTEP,
    WAIT_AFTER,
    Q,
    S,
)
from mjskip.waves._coupled_loads import MARGIN, cells_on, find_clusters, find_faces, read_surface
from mjskip.waves._medium_kernels import step_mixed
from mjskip.waves._tile_kernels import (
    PARITY,
    SURVEYED,
    USED,
    activate_block,
    activate_called,
    deactivate_calm_tiles,
    is_active,
    levels,
    step_tiles,
)

DONE, SURFACE, CALM, ROOM, CELLS, CALLED = range(6)
"""Why `coupled_steps` ends: all steps are made; a body has come near a surface that is behind the time; nobody is near
it any more; tiles or cells found no room; new tiles want to know where land is."""


@kernel
def _move_surface(c: Any, tiles: Any, medium: Any, general: Any) -> None:
    """One step of the surface under the loads."""
    numbers, counts = c.numbers, c.counts
    if counts[GENERAL] != 0:
        step_mixed(tiles, medium, numbers[Q], numbers[S], general, -1)
    else:
        step_tiles(tiles, numbers[Q], numbers[S])
    tiles.numbers[PARITY] = 1 - tiles.numbers[PARITY]
    for k in range(counts[CLUSTERS]):
        box = c.boxes[k]
        if box[FIRST] < box[LAST]:
            heads = cells_on(c.heads, box)
            faces.add_reaction(
                c.faces, box[FIRST], box[LAST], counts[SIDE], numbers[HEAD], heads, c.reactions
            )
            press_block(tiles, box[I0], box[J0], heads, numbers[EDGE], numbers[CORNER])


@kernel
def measure(c: Any, tiles: Any) -> bool:
    """Find the greatest |elevation|, give calm tiles up and activate those that waves have come next to; False if
    one found no room."""
    c.counts[STEPS] = 0
    if c.numbers[AMPLITUDE] > 0.0:
        deactivate_calm_tiles(tiles, 0.5 * c.numbers[AMPLITUDE])
    z, _ = levels(tiles)
    highest = np.float32(0.0)
    for k in range(1, tiles.numbers[USED]):
        for i in range(z.shape[1]):
            for j in range(z.shape[2]):
                highest = max(highest, abs(z[k, i, j]))
    c.numbers[HIGHEST] = highest
    return bool(activate_called(tiles, c.numbers[AMPLITUDE]))


@kernel
def _highest_under(c: Any, tiles: Any, state: Any, radius: float) -> float:
    """Greatest |z| on the cells under a body and some more [m]; 0 if no tile is active there."""
    d, half = c.numbers[SPACING], math.ceil(radius / c.numbers[SPACING]) + MARGIN
    x, y = (state[0] - c.numbers[ORIGIN_X]) / d, (state[1] - c.numbers[ORIGIN_Y]) / d
    if not (abs(x) < 1e9 and abs(y) < 1e9):
        return 0.0
    i, j, side = round(x) - half, round(y) - half, 2 * half + 1
    return highest_in(tiles, i, j, side, side) if is_active(tiles, i, j, side, side) else -1.0


@kernel
def _measure_immersion(immersion: int, c: Any, tiles: Any, loads: Any) -> Any:
    """Immersion of all bodies into their rows of loads; whether one is near the waves, and whether one may be
    wet before the step is over."""
    numbers = c.numbers
    near = wet = False
    for b in range(c.clusters.size):
        block, state = c.own[c.own_starts[b] :], c.states[b]
        call_address(
            immersion, address_of(block), address_of(state), address_of(loads[b]) + 8 * WRENCH
        )
        radius = block[hydro.RADIUS]
        speed = math.sqrt(state[12] ** 2 + state[13] ** 2 + state[14] ** 2)
        speed += radius * math.sqrt(state[15] ** 2 + state[16] ** 2 + state[17] ** 2)
        clearance = loads[b, CLEARANCE]
        if clearance < speed * numbers[TIMESTEP]:
            wet = near = True
        elif clearance < numbers[NEAR] + 2.0 * numbers[HIGHEST]:
            highest = _highest_under(c, tiles, state, radius)
            near = near or (highest >= 0.0 and clearance < numbers[NEAR] + 2.0 * highest)
    return near, wet


@kernel
def coupled_steps(
    step: int, context: Any, immersion: int, c: Any, tiles: Any, medium: Any, general: Any,
    waiting: bool, states: Any, loads: Any, reactions: Any,
) -> tuple[int, int]:  # fmt: skip
    """Steps of the bodies and their water; how many were made, and why no more.

    Args:
        step: address of what steps the engine, void(context, states after it, unused).
        context: of the engine.
        immersion: address of the kernel of the immersion.
        c: bodies and surface.
        tiles, medium, general: the water; `general` as for `step_mixed`.
        waiting: whether the surface is left where it is, behind the time, as long as nobody is near it.
        states: (m + 1, n, 18), the first given, the others filled.
        loads: (m, n, 17) at the beginning of each step.
        reactions: (m, n) vertical force that the water was given over each step, downwards [N].
    """
    counts = c.counts
    wait_after = int(c.numbers[WAIT_AFTER] / c.numbers[TIMESTEP])
    for m in range(loads.shape[0]):
        c.states[:] = states[m]
        counts[CLUSTERS] = 0
        if waiting:
            c.clusters[:] = -1
        else:
            if counts[STEPS] >= counts[BETWEEN_CHECKS] and not measure(c, tiles):
                return m, ROOM
            if not find_clusters(c):
                return m, CELLS
        read_surface(c, tiles)
        near, wet = _measure_immersion(immersion, c, tiles, loads[m])
        if waiting and near:
            return m, SURFACE
        if not waiting:
            counts[DRY_STEPS] = 0 if near else counts[DRY_STEPS] + 1
            if counts[DRY_STEPS] > wait_after:
                return m, CALM
            for k in range(counts[CLUSTERS] if wet else 0):
                box = c.boxes[k]
                if not activate_block(tiles, box[I0] - 1, box[J0] - 1, box[NX0] + 2, box[NY0] + 2):
                    return m, ROOM
            if counts[GENERAL] != 0 and tiles.numbers[USED] > tiles.numbers[SURVEYED]:
                return m, CALLED

        c.reactions[:] = 0.0
        counts[STAGE] = 0
        if c.numbers[AHEAD] >= 0.0:
            find_faces(c)
        call_address(step, address_of(context), address_of(states[m + 1]), 0)
        loads[m, :, :WRENCH] = c.first
        if counts[FAILED] != 0:
            return m + 1, DONE
        if not waiting:
            counts[STEPS] += 1
            _move_surface(c, tiles, medium, general)
            reactions[m] = c.reactions
    return loads.shape[0], DONE
