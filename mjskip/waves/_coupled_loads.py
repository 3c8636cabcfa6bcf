"""The surface under bodies, and what water and air do to them there: within a step of `_coupled_kernels`.

Bodies whose blocks of cells meet share one; others are solved by themselves.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, as_words, call_address
from mjskip.hydro import _block as hydro
from mjskip.hydro.columns import WRENCH
from mjskip.waves import _face_kernels as faces
from mjskip.waves._block_kernels import read_moving_block
from mjskip.waves._coupled_arrays import (
    AHEAD,
    CELL,
    CLUSTERS,
    CORNER,
    EDGE,
    FACTOR,
    FAILED,
    FIRST,
    HIGHEST,
    I0,
    J0,
    LAST,
    NEAR,
    NX0,
    NY0,
    ORIGIN_X,
    ORIGIN_Y,
    PATCH,
    RADIUS,
    SIDE,
    SPACING,
    STAGE,
    STAGES,
    TIMESTEP,
    TOLERANCE,
    Q,
)

MARGIN = 3
"""Cells of a block beyond what a body and its bumps can reach in a step: slopes and the Laplacian need neighbours."""

MAX_SWEEPS = 1000

RK4_WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)


@kernel
def patch_on(c: Any, cluster: int) -> Any:
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
def cells_on(array: Any, box: Any) -> Any:
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
        frame, level, rate = patch_on(c, k)
        highest, c.fastest[k] = read_moving_block(
            tiles, box[I0], box[J0], known, wide, level, rate, cells_on(c.open_cells, box)
        )
        head = c.patches[box[PATCH] : box[PATCH] + hydro.PATCH_POINTS]
        head[hydro.PATCH_X], head[hydro.PATCH_Y] = frame[0], frame[1]
        head[hydro.PATCH_RATE] = 1.0 / numbers[SPACING]
        head[hydro.PATCH_NX], head[hydro.PATCH_NY] = nx, ny
        head[hydro.PATCH_HIGHEST] = highest
        cells_on(c.heads, box)[:] = 0.0
    for b in range(c.clusters.size):
        address = 0
        if c.clusters[b] >= 0:
            address = address_of(c.patches) + 8 * c.boxes[c.clusters[b], PATCH]
        _look_at(c.own[c.own_starts[b] :], address)
        _look_at(c.rest[c.rest_starts[b] :], address)


@kernel
def find_faces(c: Any) -> None:
    """The wet faces of all bodies where they will be, spread on the cells."""
    counts, numbers, found = c.counts, c.numbers, 0
    for k in range(counts[CLUSTERS]):
        box = c.boxes[k]
        frame, level, rate = patch_on(c, k)
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
            cells_on(c.open_cells, box), c.impulse, c.guesses,
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
                numbers[TOLERANCE], MAX_SWEEPS, cells_on(c.field, box), c.turns,
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
