"""A step of n bodies and their water in compiled code: look at the surface, force, engine step, surface step.

    level z[n], rate (z_free[n+1] - z[n-1]) / (2 dt)      on a block of cells under the bodies
    wet faces                                              where the bodies will be in the middle of the step
    loads f of the law, solved with the surface            at the velocities as they are (`_face_kernels`)
    engine step                                            later evaluations: the law at their velocities
    z[n+1] = z_free[n+1] + response to the loads           weighted as the engine weights its evaluations

The engine is a C function void(context, states, unused) that makes a step and writes the states (n, 18) after
it. On its way it lets `add_loads` find the loads, as often as it evaluates forces.

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
from mjskip.rigid.state import STATE
from mjskip.waves import _coupling_kernels as coupling
from mjskip.waves import _face_kernels as faces
from mjskip.waves._block_kernels import highest_in, press_block, read_moving_block
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
    TIMESTEP, SPACING, ORIGIN_X, ORIGIN_Y, RADIUS, TOLERANCE, FACTOR, NEAR, HEAD, HIGHEST,
    Q, S, EDGE, CORNER, AMPLITUDE, WAIT_AFTER, AHEAD,
) = range(17)  # fmt: skip
"""Of `numbers`: dt [s]; cells d [m] and where cell (0, 0) is; radius of the bumps [m], tolerance of the loads;
dt / (2 rho d^2 (1 + mu dt / 2)); clearance above the waves at which a body is near them [m]; pressure head of a
newton on a cell [m]; greatest |z| when last measured [m]; q and s of a free step, what edges and corners of a head
add in it; the sleep amplitude [m]; dry time after which the surface may wait [s]; how far ahead the wet faces are
looked for [s], negative if the engine does that itself."""
NUMBERS = 17

CLUSTERS, STAGE, STAGES, FAILED, DRY_STEPS, STEPS, GENERAL, SIDE, BETWEEN_CHECKS = range(9)
"""Of `counts`: blocks of cells now; evaluations made in this step, and those that a step makes; the first body
whose force was not finite, plus 1; steps since a body was near the waves; steps since the last look for calm
tiles; whether some tiles need a general step; cells across a bump at most; steps between looks."""
COUNTS = 9

DONE, SURFACE, CALM, ROOM, CELLS, CALLED = range(6)
"""Why `coupled_steps` ends: all steps are made; a body has come near a surface that is behind the time; nobody is near
it any more; tiles or cells found no room; new tiles want to know where land is."""

I0, J0, NX0, NY0, PATCH, CELL, FIRST, LAST = range(8)
"""Of a row of `boxes`: first cell, cells along x and y, where the patch begins, where its other cells begin, which
faces lie on it."""
BOX = 8

MOST_SWEEPS = 1000

MARGIN = 3
"""Cells of a block beyond what a body and its bumps can reach in a step: slopes and the Laplacian need neighbours."""

RK4_WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)


class Coupled(NamedTuple):
    """Bodies and the blocks of surface under them.

    Attributes:
        own, own_starts: blocks of the bodies in a row, and where each begins: what is immersed.
        rest, rest_starts: those without the law: air, and buoyancy and skin friction if the water has them.
        split, split_starts: those whose faces are no longer than the bumps' radius: what the law loads.
        vertices, vertex_starts: of the split bodies (v, 3), body axes [m], and where each body's begin.
        corners, panels, face_starts: of those faces, see `find_wet_faces`.
        states: at the present evaluation (n, 18).
        poses: where the wet faces are looked for (n, 18).
        means: states with the velocities that a kick's loads act on (n, 18).
        mobilities: (n, MOBILITY), for a kick.
        wrenches: water and air at the present evaluation (n, 12).
        first: the same at a step's first evaluation (n, 12).
        reactions: vertical force of the law over the step, as its evaluations are weighted (n,) [N].
        clusters: which block of cells each body is on; -1 if on none (n,).
        boxes: of the blocks of cells (n, BOX).
        fastest: greatest |rate| on each of them [m/s].
        patches: for each of them a patch of `mjskip.hydro._block`: level and rate.
        heads, open_cells, field: on their cells: pressure head [m], 1 in water, scratch.
        wide: scratch for two levels and their rims.
        faces: wet ones, see `_face_kernels`.
        guesses: loads of all faces when they were last solved [N].
        heights, turns: scratch of those.
        impulse: G of a unit on one cell (3, 3) [1/m].
        numbers, counts: see above.
    """

    own: Array
    own_starts: Integers
    rest: Array
    rest_starts: Integers
    split: Array
    split_starts: Integers
    vertices: Array
    vertex_starts: Integers
    corners: Integers
    panels: Array
    face_starts: Integers
    states: Array
    poses: Array
    means: Array
    mobilities: Array
    wrenches: Array
    first: Array
    reactions: Array
    clusters: Integers
    boxes: Integers
    fastest: Array
    patches: Array
    heads: Array
    open_cells: Array
    field: Array
    wide: Array
    faces: Array
    guesses: Array
    heights: Array
    turns: Array
    impulse: Array
    numbers: Array
    counts: Integers


# The surface under the bodies --------------------------------------------------------------------


@kernel
def _patch(c: Any, cluster: int) -> Any:
    """Frame, level and rate of a block of cells."""
    i0, j0, nx, ny = (
        c.boxes[cluster, I0],
        c.boxes[cluster, J0],
        c.boxes[cluster, NX0],
        c.boxes[cluster, NY0],
    )
    at = c.boxes[cluster, PATCH] + hydro.PATCH_POINTS
    size = nx * ny
    level = c.patches[at : at + size].reshape(nx, ny)
    rate = c.patches[at + size : at + 2 * size].reshape(nx, ny)
    d = c.numbers[SPACING]
    x, y = c.numbers[ORIGIN_X] + i0 * d, c.numbers[ORIGIN_Y] + j0 * d
    return (x, y, d, c.fastest[cluster]), level, rate


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
    return bool(cell <= c.heads.size)


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
    """Copy the surface into the patches; nothing presses on it yet."""
    numbers = c.numbers
    known = numbers[Q], numbers[EDGE], numbers[CORNER], 0.5 / numbers[TIMESTEP]
    for k in range(c.counts[CLUSTERS]):
        box = c.boxes[k]
        nx, ny = box[NX0], box[NY0]
        rim = (nx + 2) * (ny + 2)
        wide = c.wide[:rim].reshape(nx + 2, ny + 2), c.wide[rim : 2 * rim].reshape(nx + 2, ny + 2)
        frame, level, rate = _patch(c, k)
        highest, c.fastest[k] = read_moving_block(
            tiles, box[I0], box[J0], known, wide, level, rate, _cells(c.open_cells, box)
        )
        head = c.patches[box[PATCH] : box[PATCH] + hydro.PATCH_POINTS]
        head[hydro.PATCH_X], head[hydro.PATCH_Y] = frame[0], frame[1]
        head[hydro.PATCH_RATE] = 1.0 / numbers[SPACING]
        head[hydro.PATCH_NX], head[hydro.PATCH_NY] = nx, ny
        head[hydro.PATCH_HIGHEST] = highest
        _cells(c.heads, box)[:] = 0.0
    for b in range(c.clusters.size):
        address = 0
        if c.clusters[b] >= 0:
            address = address_of(c.patches) + 8 * c.boxes[c.clusters[b], PATCH]
        _look_at(c.own[c.own_starts[b] :], address)
        _look_at(c.rest[c.rest_starts[b] :], address)


# Loads -------------------------------------------------------------------------------------------


@kernel
def find_faces(c: Any) -> None:
    """The wet faces of all bodies where they will be, spread on the cells."""
    counts, numbers, found = c.counts, c.numbers, 0
    for k in range(counts[CLUSTERS]):
        box = c.boxes[k]
        frame, level, rate = _patch(c, k)
        box[FIRST] = found
        for b in range(c.clusters.size):
            if c.clusters[b] == k:
                v0, v1 = c.vertex_starts[b], c.vertex_starts[b + 1]
                f0, f1 = c.face_starts[b], c.face_starts[b + 1]
                faces.place_ahead(c.states[b], max(numbers[AHEAD], 0.0), c.poses[b])
                found = faces.find_wet_faces(
                    c.split[c.split_starts[b] :], c.vertices[v0:v1], c.corners[f0:f1],
                    c.panels[f0:f1], c.poses[b], frame, level, b, f0, c.guesses, c.heights,
                    c.faces, found,
                )  # fmt: skip
        found = faces.spread_faces(
            c.faces, box[FIRST], found, counts[SIDE], numbers[RADIUS], c.states, frame, rate,
            _cells(c.open_cells, box), c.impulse, c.guesses,
        )  # fmt: skip
        box[LAST] = found


@kernel
def rest_loads(wrench: int, c: Any) -> None:
    """Air, buoyancy and skin friction on all bodies at their states, into `wrenches`; `wrench` is the address of
    the force kernel."""
    for b in range(c.clusters.size):
        rest, out = c.rest[c.rest_starts[b] :], c.wrenches[b]
        call_address(wrench, address_of(rest), address_of(c.states[b]), address_of(out))


@kernel
def add_loads(c: Any, kick: float) -> None:
    """Add the law's loads on all bodies at their velocities to `wrenches`.

    Args:
        c: bodies and surface, their wet faces found.
        kick: half of the step if the bodies are kicked by what is found here; 0 inside another integrator [s].
    """
    counts, numbers = c.counts, c.numbers
    weight = RK4_WEIGHTS[min(counts[STAGE], 3)] if counts[STAGES] == 4 else 1.0
    for k in range(counts[CLUSTERS]):
        box = c.boxes[k]
        first, last = box[FIRST], box[LAST]
        if first == last:
            continue
        if counts[STAGE] == 0:
            faces.solve_faces(
                c.faces, first, last, counts[SIDE], numbers[FACTOR],
                c.means if kick > 0.0 else c.states, c.mobilities, kick,
                numbers[TOLERANCE], MOST_SWEEPS, _cells(c.field, box), c.turns,
            )  # fmt: skip
            for n in range(first, last):
                c.guesses[int(c.faces[n, faces.PANEL])] = c.faces[n, faces.LOAD]
        else:
            faces.reload_faces(c.faces, first, last, c.states)
        faces.add_wrenches(c.faces, first, last, weight, c.wrenches)
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
            heads = _cells(c.heads, box)
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
        _rows(w, 6), _integers(w, 7), _integer_rows(w, 8), _rows(w, 9), _integers(w, 10),
        _rows(w, 11), _rows(w, 12), _rows(w, 13), _rows(w, 14), _rows(w, 15), _rows(w, 16), _doubles(w, 17),
        _integers(w, 18), _integer_rows(w, 19), _doubles(w, 20),
        _doubles(w, 21), _doubles(w, 22), _doubles(w, 23), _doubles(w, 24), _doubles(w, 25),
        _rows(w, 26), _doubles(w, 27), _doubles(w, 28), _rows(w, 29), _rows(w, 30), _doubles(w, 31),
        _integers(w, 32),
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
    find_faces(c)
    add_loads(c, 0.5 * timestep)
    for b in range(n):
        for k in range(6):
            y[b, rigid.P + k] += timestep * (c.wrenches[b, k] + c.wrenches[b, 6 + k])
        coupling.free_flight(rows[b], y[b], 0.5 * timestep, TURN, c.states[b])
        rigid.motion(rows[b], y[b], c.states[b])
        for k in range(STATE):
            states_out[STATE * b + k] = c.states[b, k]
