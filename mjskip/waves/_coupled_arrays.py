"""The arrays of bodies on moving water: what kernels, and C functions that are given an address, know of them."""

from typing import Any, NamedTuple

import numba

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, as_words
from mjskip._typing import Array, Integers

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


I0, J0, NX0, NY0, PATCH, CELL, FIRST, LAST = range(8)
"""Of a row of `boxes`: first cell, cells along x and y, where the patch begins, where its other cells begin, which
faces lie on it."""
BOX = 8


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
