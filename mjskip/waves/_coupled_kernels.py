"""A step of n bodies and their water in compiled code: look at the surface, force, engine step, surface step.

    level z[n], rate (z_free[n+1] - z[n-1]) / (2 dt)      on a block of cells under the bodies
    loads f of the law, solved with the surface            at each evaluation of the engine (`_coupling_kernels`)
    engine step                                            its stages weighted as it weights them
    z[n+1] = z_free[n+1] + response to the loads

The engine is a C function void(context, states, unused) that makes a step and writes the states (n, 18) after
it. On its way it lets `solve_stage` find the loads, as often as it evaluates forces.

Bodies whose blocks of cells meet share one; others are solved by themselves.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, as_doubles, as_words, bits, call_address
from mjskip._typing import Array
from mjskip.hydro import _block as hydro
from mjskip.hydro.columns import CLEARANCE, WRENCH
from mjskip.rigid import _rigid_kernels as rigid
from mjskip.waves import _coupling_kernels as coupling
from mjskip.waves._block_kernels import press_block, read_moving_block
from mjskip.waves._medium_kernels import step_mixed
from mjskip.waves._tile_kernels import (
    PARITY,
    SURVEYED,
    USED,
    Integers,
    activate_block,
    activate_called,
    deactivate_calm_tiles,
    is_active,
    levels,
    step_tiles,
)

(
    TIMESTEP, SPACING, ORIGIN_X, ORIGIN_Y, RADIUS, PER_METRE, TOLERANCE, FACTOR, NEAR, HEAD, HIGHEST,
    Q, S, EDGE, CORNER, AMPLITUDE, WAIT_AFTER,
) = range(17)  # fmt: skip
"""Of `numbers`: dt [s]; cells d [m] and where cell (0, 0) is; radius of the bumps [m], entries of the profile per
metre, tolerance of the loads; dt / (2 rho (1 + mu dt / 2)); clearance above the waves at which a body is near them
[m]; pressure head of a pascal [m]; greatest |z| when last measured [m]; q and s of a free step, what edges and
corners of a head add in it; the sleep amplitude [m]; dry time after which the surface may wait [s]."""
NUMBERS = 17

CLUSTERS, STAGE, STAGES, FAILED, DRY_STEPS, STEPS, GENERAL = range(7)
"""Of `counts`: blocks of cells now; evaluations made in this step, and those that a step makes; the first body
whose force was not finite, plus 1; steps since a body was near the waves; steps since the last look for calm
tiles; whether some tiles need a general step."""
COUNTS = 7

DONE, SURFACE, CALM, ROOM, CELLS, CALLED = range(6)
"""Why `coupled_steps` ends: all steps are made; a body has come near a surface that is behind the time; nobody is near
it any more; tiles or cells found no room; new tiles want to know where land is."""

I0, J0, NX0, NY0, PATCH, CELL = range(6)
"""Of a row of `boxes`: first cell, cells along x and y, where the patch begins, where its other cells begin."""
BOX = 6

MARGIN = 3
"""Cells of a block beyond what a body and its bumps can reach in a step: slopes and the Laplacian need neighbours."""

STEPS_BETWEEN_CHECKS = 16
"""Steps between looks for calm tiles and for the greatest elevation."""

RK4_WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)


class Coupled(NamedTuple):
    """Bodies and the blocks of surface under them.

    Attributes:
        split, split_starts: blocks of the bodies whose triangles are no longer than the bumps' radius, in a row,
            and where each begins: what the law loads.
        own, own_starts: their blocks as they are: what is immersed.
        rest, rest_starts: those without the law: air, and buoyancy and skin friction if the water has them.
        states: at the present evaluation (n, 18).
        means: states with the velocities that the loads act on (n, 18).
        mobilities: (n, coupling.MOBILITY), for a kick.
        wrenches: water and air at the present evaluation (n, 12).
        first: the same at a step's first evaluation (n, 12).
        reactions: vertical force of the law over the step, as its stages are weighted (n,) [N].
        clusters: which block of cells each body is on; -1 if on none (n,).
        boxes: of the blocks of cells (n, BOX).
        patches: for each of them a patch of `mjskip.hydro._block`: level and rate.
        pressure, open_cells, field: on their cells [Pa], 1 in water, scratch.
        wide: scratch for two levels and their rims.
        faces, spots, matrix, speeds, loads: of the solver.
        impulse, profile: of the water; one is empty.
        numbers, counts: see above.
    """

    split: Array
    split_starts: Integers
    own: Array
    own_starts: Integers
    rest: Array
    rest_starts: Integers
    states: Array
    means: Array
    mobilities: Array
    wrenches: Array
    first: Array
    reactions: Array
    clusters: Integers
    boxes: Integers
    patches: Array
    pressure: Array
    open_cells: Array
    field: Array
    wide: Array
    faces: Array
    spots: Array
    matrix: Array
    speeds: Array
    loads: Array
    impulse: Array
    profile: Array
    numbers: Array
    counts: Integers


# The surface under the bodies --------------------------------------------------------------------


@kernel
def _patch(c: Any, cluster: int) -> Any:
    """Frame, level and rate of a block of cells."""
    i0, j0, nx, ny = c.boxes[cluster, I0], c.boxes[cluster, J0], c.boxes[cluster, NX0], c.boxes[cluster, NY0]
    at = c.boxes[cluster, PATCH] + hydro.PATCH_POINTS
    size = nx * ny
    level = c.patches[at : at + size].reshape(nx, ny)
    rate = c.patches[at + size : at + 2 * size].reshape(nx, ny)
    d = c.numbers[SPACING]
    x, y = c.numbers[ORIGIN_X] + i0 * d, c.numbers[ORIGIN_Y] + j0 * d
    return (x, y, d, c.patches[at - hydro.PATCH_POINTS + hydro.PATCH_HIGHEST]), level, rate


@kernel
def _cells(array: Any, box: Any) -> Any:
    """The cells of a block in one of the arrays that hold all of them."""
    nx, ny = box[NX0], box[NY0]
    return array[box[CELL] : box[CELL] + nx * ny].reshape(nx, ny)


@kernel
def _look_at(block: Any, address: int) -> None:
    """Let a body's block feel a patch; still water if that is 0."""
    as_words(address_of(block))[hydro.SURFACE] = address


@kernel
def find_clusters(c: Any) -> bool:
    """Put boxes of cells about the bodies near the waves, joined where they meet; False if cells lack room."""
    numbers, counts, boxes, clusters = c.numbers, c.counts, c.boxes, c.clusters
    d, found = numbers[SPACING], 0
    for b in range(clusters.size):
        state, block = c.states[b], c.own[c.own_starts[b] :]
        clusters[b] = -1
        if not state[2] - block[hydro.RADIUS] < numbers[NEAR] + 2.0 * numbers[HIGHEST]:
            continue
        speed = math.sqrt(state[12] ** 2 + state[13] ** 2 + state[14] ** 2)
        reach = block[hydro.RADIUS] + numbers[RADIUS] + speed * numbers[TIMESTEP]
        x, y = (state[0] - numbers[ORIGIN_X]) / d, (state[1] - numbers[ORIGIN_Y]) / d
        if not (abs(x) < 1e9 and abs(y) < 1e9 and reach < 1e6 * d):
            continue
        half = math.ceil(reach / d) + MARGIN
        clusters[b] = found
        boxes[found, I0], boxes[found, J0] = round(x) - half, round(y) - half
        boxes[found, NX0] = boxes[found, NY0] = 2 * half + 1
        found += 1
    k = 0
    while k < found:  # join each with the first that it meets, and begin anew
        for m in range(k):
            if _meet(boxes[k], boxes[m]):
                _join(boxes[m], boxes[k])
                for n in range(clusters.size):
                    if clusters[n] == k:
                        clusters[n] = m
                    elif clusters[n] > k:
                        clusters[n] -= 1
                found -= 1
                for n in range(k, found):
                    boxes[n] = boxes[n + 1]
                k = 0
                break
        k += 1
    counts[CLUSTERS] = found
    patch = cell = 0
    for k in range(found):
        size = boxes[k, NX0] * boxes[k, NY0]
        boxes[k, PATCH], boxes[k, CELL] = patch, cell
        patch += hydro.PATCH_POINTS + 2 * size
        cell += size
    return cell <= c.pressure.size


@kernel
def _meet(one: Any, other: Any) -> bool:
    return bool(
        one[I0] <= other[I0] + other[NX0]
        and other[I0] <= one[I0] + one[NX0]
        and one[J0] <= other[J0] + other[NY0]
        and other[J0] <= one[J0] + one[NY0]
    )


@kernel
def _join(box: Any, other: Any) -> None:
    i1 = max(box[I0] + box[NX0], other[I0] + other[NX0])
    j1 = max(box[J0] + box[NY0], other[J0] + other[NY0])
    box[I0], box[J0] = min(box[I0], other[I0]), min(box[J0], other[J0])
    box[NX0], box[NY0] = i1 - box[I0], j1 - box[J0]


@kernel
def read_surface(c: Any, tiles: Any) -> None:
    """Copy the surface into the patches; no pressure yet."""
    numbers = c.numbers
    known = numbers[Q], numbers[EDGE], numbers[CORNER], 0.5 / numbers[TIMESTEP]
    for k in range(c.counts[CLUSTERS]):
        box = c.boxes[k]
        nx, ny = box[NX0], box[NY0]
        rim = (nx + 2) * (ny + 2)
        wide = c.wide[:rim].reshape(nx + 2, ny + 2), c.wide[rim : 2 * rim].reshape(nx + 2, ny + 2)
        frame, level, rate = _patch(c, k)
        highest = read_moving_block(
            tiles, box[I0], box[J0], known, wide, level, rate, _cells(c.open_cells, box)
        )
        head = c.patches[box[PATCH] : box[PATCH] + hydro.PATCH_POINTS]
        head[hydro.PATCH_X], head[hydro.PATCH_Y] = frame[0], frame[1]
        head[hydro.PATCH_RATE] = 1.0 / numbers[SPACING]
        head[hydro.PATCH_NX], head[hydro.PATCH_NY] = nx, ny
        head[hydro.PATCH_HIGHEST] = highest
        _cells(c.pressure, box)[:] = 0.0
    for b in range(c.clusters.size):
        address = 0
        if c.clusters[b] >= 0:
            address = address_of(c.patches) + 8 * c.boxes[c.clusters[b], PATCH]
        _look_at(c.own[c.own_starts[b] :], address)
        _look_at(c.rest[c.rest_starts[b] :], address)


# Loads -------------------------------------------------------------------------------------------


@kernel
def rest_loads(wrench: int, c: Any) -> None:
    """Air, buoyancy and skin friction on all bodies at their states, into `wrenches`; `wrench` is the address of
    the force kernel."""
    for b in range(c.clusters.size):
        rest, out = c.rest[c.rest_starts[b] :], c.wrenches[b]
        call_address(wrench, address_of(rest), address_of(c.states[b]), address_of(out))


@kernel
def solve_stage(c: Any, kick: float) -> None:
    """Add the law's loads on all bodies at their states to `wrenches`, and the pressure that goes with them.

    Args:
        c: bodies and surface.
        kick: half of the step if the bodies are kicked by what is found here; 0 inside another integrator [s].
    """
    counts, numbers = c.counts, c.numbers
    stage = min(counts[STAGE], 3)
    weight = RK4_WEIGHTS[stage] if counts[STAGES] == 4 else 1.0
    for k in range(counts[CLUSTERS]):
        box = c.boxes[k]
        frame, level, rate = _patch(c, k)
        count = 0
        for b in range(c.clusters.size):
            if c.clusters[b] == k:
                block = c.split[c.split_starts[b] : c.split_starts[b + 1]]
                count = coupling.find_faces(block, c.states[b], frame, level, b, c.faces, count)
        if count == 0:
            continue
        coupling.solve_faces(
            count, c.means if kick > 0.0 else c.states,
            (frame, level, rate, _cells(c.open_cells, box)), numbers[RADIUS],
            (c.impulse, c.profile, numbers[PER_METRE]), numbers[FACTOR], c.mobilities, kick,
            numbers[TOLERANCE], (c.faces, c.spots, c.matrix, c.speeds, c.loads, _cells(c.field, box)),
        )  # fmt: skip
        coupling.add_wrench(c.faces, count, c.loads, c.wrenches)
        for n in range(count):
            c.loads[n] *= weight
            c.reactions[int(c.faces[n, coupling.BODY])] -= c.loads[n] * c.faces[n, coupling.NORMAL + 2]
        side = math.floor(2.0 * numbers[RADIUS] / numbers[SPACING]) + 1
        coupling.add_pressure(
            c.faces, count, c.spots, side, c.loads, numbers[SPACING], _cells(c.pressure, box)
        )
    for b in range(c.clusters.size):
        total = 0.0
        for n in range(WRENCH):
            total += c.wrenches[b, n]
        if not np.isfinite(total):
            if counts[FAILED] == 0:
                counts[FAILED] = b + 1
            c.wrenches[b] = 0.0
    if counts[STAGE] == 0:
        c.first[:] = c.wrenches
    counts[STAGE] += 1


# Steps -------------------------------------------------------------------------------------------


@kernel
def _move_surface(c: Any, tiles: Any, medium: Any, general: Any) -> bool:
    """One step of the surface under the pressure; False if a tile found no room."""
    numbers, counts = c.numbers, c.counts
    if counts[GENERAL] != 0:
        step_mixed(tiles, medium, numbers[Q], numbers[S], general, -1)
    else:
        step_tiles(tiles, numbers[Q], numbers[S])
    tiles.numbers[PARITY] = 1 - tiles.numbers[PARITY]
    for k in range(counts[CLUSTERS]):
        box = c.boxes[k]
        pressure = _cells(c.pressure, box)
        pressed = False
        for i in range(box[NX0]):
            for j in range(box[NY0]):
                pressure[i, j] *= numbers[HEAD]
                pressed = pressed or pressure[i, j] != 0.0
        if pressed:
            press_block(tiles, box[I0], box[J0], pressure, numbers[EDGE], numbers[CORNER])
    return bool(activate_called(tiles, numbers[AMPLITUDE]))


@kernel
def measure(c: Any, tiles: Any) -> None:
    """Find the greatest |elevation|, and give calm tiles up."""
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


@kernel
def _how_near(immersion: int, c: Any, tiles: Any, loads: Any) -> Any:
    """Immersion of all bodies into their rows of loads; whether one is near the waves, and whether one may be
    wet before the step is over."""
    numbers = c.numbers
    near = wet = False
    for b in range(c.clusters.size):
        block, state = c.own[c.own_starts[b] :], c.states[b]
        call_address(
            immersion, address_of(block), address_of(state), address_of(loads[b]) + 8 * WRENCH
        )
        speed = math.sqrt(state[12] ** 2 + state[13] ** 2 + state[14] ** 2)
        speed += block[hydro.RADIUS] * math.sqrt(state[15] ** 2 + state[16] ** 2 + state[17] ** 2)
        clearance = loads[b, CLEARANCE]
        soon = clearance < speed * numbers[TIMESTEP]
        if soon:
            wet = near = True
        elif clearance < numbers[NEAR] + 2.0 * numbers[HIGHEST]:
            d, half = numbers[SPACING], math.ceil(block[hydro.RADIUS] / numbers[SPACING]) + MARGIN
            x, y = (state[0] - numbers[ORIGIN_X]) / d, (state[1] - numbers[ORIGIN_Y]) / d
            if abs(x) < 1e9 and abs(y) < 1e9:
                side = 2 * half + 1
                near = near or is_active(tiles, round(x) - half, round(y) - half, side, side)
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
            if counts[STEPS] >= STEPS_BETWEEN_CHECKS:
                measure(c, tiles)
            if not find_clusters(c):
                return m, CELLS
        read_surface(c, tiles)
        near, wet = _how_near(immersion, c, tiles, loads[m])
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
        call_address(step, address_of(context), address_of(states[m + 1]), 0)
        loads[m, :, :WRENCH] = c.first
        reactions[m] = c.reactions
        if counts[FAILED] != 0:
            return m + 1, DONE
        if not waiting:
            counts[STEPS] += 1
            if not _move_surface(c, tiles, medium, general):
                return m + 1, ROOM
            if counts[GENERAL] != 0 and tiles.numbers[USED] > tiles.numbers[SURVEYED]:
                return m + 1, CALLED
    return loads.shape[0], DONE


# By address, for C functions ---------------------------------------------------------------------


@kernel
def _doubles(words: Any, k: int) -> Any:
    return numba.carray(as_doubles(words[3 * k]), words[3 * k + 1])


@kernel
def _rows(words: Any, k: int) -> Any:
    return numba.carray(as_doubles(words[3 * k]), (words[3 * k + 1], words[3 * k + 2]))


@kernel
def _integers(words: Any, k: int) -> Any:
    return numba.carray(as_words(words[3 * k]), words[3 * k + 1])


@kernel
def _integer_rows(words: Any, k: int) -> Any:
    return numba.carray(as_words(words[3 * k]), (words[3 * k + 1], words[3 * k + 2]))


@kernel
def coupled_at(address: int) -> Any:
    """`Coupled` from its words: address, rows and columns of each array in turn."""
    w = as_words(address)
    return Coupled(
        _doubles(w, 0), _integers(w, 1), _doubles(w, 2), _integers(w, 3), _doubles(w, 4), _integers(w, 5),
        _rows(w, 6), _rows(w, 7), _rows(w, 8), _rows(w, 9), _rows(w, 10), _doubles(w, 11),
        _integers(w, 12), _integer_rows(w, 13),
        _doubles(w, 14), _doubles(w, 15), _doubles(w, 16), _doubles(w, 17), _doubles(w, 18),
        _rows(w, 19), _rows(w, 20), _rows(w, 21), _doubles(w, 22), _doubles(w, 23),
        _rows(w, 24), _doubles(w, 25), _doubles(w, 26), _integers(w, 27),
    )  # fmt: skip


KICK_COUPLED, KICK_WRENCH, KICK_Y, KICK_ROWS, KICK_TIMESTEP = range(5)
"""Of the context of `kick_step`: address of the words of `Coupled`, of the force kernel, of x, q, P, L of the bodies
(n, 13) and of their rows (n, rigid.BODY), as the bits of doubles; dt [s]."""

TURN = 0.02
"""Greatest angle of one step of a free flight [rad]: energy is then kept to 1e-10 a second at hundreds of turns."""


def kick_step(context: Any, states_out: Any, _unused: Any) -> None:
    """A step of the pure integrator over waves: void(double*, double*, double*).

    Free flight over half the step, a kick by water and air at the pose there, free flight over the other half.
    The loads are solved with the mean of the velocities before and after the kick: with the surface's step the
    energy of both falls by what the relative motion dissipates, to rounding.
    """
    c = coupled_at(bits(context[KICK_COUPLED]))
    n = c.clusters.size
    y = numba.carray(as_doubles(bits(context[KICK_Y])), (n, rigid.SIZE))
    rows = numba.carray(as_doubles(bits(context[KICK_ROWS])), (n, rigid.BODY))
    timestep = context[KICK_TIMESTEP]
    for b in range(n):
        coupling.free_flight(rows[b], y[b], 0.5 * timestep, TURN, c.states[b])
        rigid.motion(rows[b], y[b], c.states[b])
    rest_loads(bits(context[KICK_WRENCH]), c)
    for b in range(n):
        for k in range(6):
            c.first[b, k] = c.wrenches[b, k] + c.wrenches[b, 6 + k]
    coupling.prepare_kick(y, rows, c.first, timestep, c.states, c.means, c.mobilities)
    solve_stage(c, 0.5 * timestep)
    for b in range(n):
        for k in range(6):
            y[b, rigid.P + k] += timestep * (c.wrenches[b, k] + c.wrenches[b, 6 + k])
        coupling.free_flight(rows[b], y[b], 0.5 * timestep, TURN, c.states[b])
        rigid.motion(rows[b], y[b], c.states[b])
        for k in range(rigid.STATE):
            states_out[rigid.STATE * b + k] = c.states[b, k]
