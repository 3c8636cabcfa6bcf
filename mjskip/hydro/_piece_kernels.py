"""Faces near the surface: which are quite under it, and the wet pieces of those that it cuts.

    sides    of every face of a run a byte: WHOLE if it is quite under, CROSSED if it must be cut, else 0
    pieces   what is wet, in columns as the faces of a block have them, and their areas
    cuts     faces that are cut, gathered into columns: corners (9), heights (3), normal (3), area

Buoyancy, the pressure -rho g h integrated exactly over what is immersed, is added up on the way.
"""

from typing import Any

import numpy as np

from mjskip._compile.jit import inlined, kernel, vector_kernel
from mjskip._compile.pointers import as_bytes, as_words, place_of, stack_doubles
from mjskip._compile.vector import copy_vector, lowest_byte, select
from mjskip.hydro._block import (
    AREA,
    CENTROID,
    FACES,
    HEADER,
    HEIGHT,
    LOCAL_GATE,
    NORMAL,
    PIECE,
    RISE,
    SKIN_DENSITY,
    STRIDE,
    UP,
    VELOCITY,
    WIDTH,
)
from mjskip.hydro._clip_kernels import column, cut, immersed_part
from mjskip.hydro._load_kernels import add_sums
from mjskip.hydro._patch_kernels import surface_at

RUN = 256
"""Faces that are looked at together: groups on the same side of the surface."""

PIECES, CUTS = 1032, 520
"""Room for pieces and for faces to cut; columns a multiple of 4096 bytes apart would share places in the cache."""

HEIGHTS, CUT_NORMAL, CUT_AREA, CUT = 9, 12, 15, 16


WHOLE, CROSSED = 2, 1
EVERY_WHOLE, EVERY_CROSSED = 0x0202020202020202, 0x0101010101010101


@vector_kernel
def find_sides(
    block: Any,
    motion: Any,
    first: int,
    count: int,
    weight: float,
    sides: Any,
    sums: Any,
) -> None:
    """Fill `sides` of a run of faces over still water; buoyancy of those quite under it.

    Heights are h = z + u.r. A face that the paper's gate leaves without load need not be cut for a law alone.
    """
    n = int(block[STRIDE])
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    every = block[LOCAL_GATE] != 0.0 or weight != 0.0 or block[SKIN_DENSITY] != 0.0
    least = -np.inf if every else 0.0
    fx = fy = fz = tx = ty = tz = 0.0
    for i in range(count):
        k = HEADER + first + i
        ax, ay, az = block[k], block[k + n], block[k + 2 * n]
        bx, by, bz = block[k + 3 * n], block[k + 4 * n], block[k + 5 * n]
        cx, cy, cz = block[k + 6 * n], block[k + 7 * n], block[k + 8 * n]
        ha = z + ux * ax + uy * ay + uz * az
        hb = z + ux * bx + uy * by + uz * bz
        hc = z + ux * cx + uy * cy + uz * cz
        corners = select(ha < 0.0, 1.0, 0.0) + select(hb < 0.0, 1.0, 0.0)
        corners += select(hc < 0.0, 1.0, 0.0)
        area = select(corners == 3.0, block[k + AREA * n], 0.0)
        k += FACES * n
        nx, ny, nz = block[k], block[k + n], block[k + 2 * n]
        total = ha + hb + hc
        mx = area * ((ax + bx + cx) * total + ax * ha + bx * hb + cx * hc)
        my = area * ((ay + by + cy) * total + ay * ha + by * hb + cy * hc)
        mz = area * ((az + bz + cz) * total + az * ha + bz * hb + cz * hc)
        load = 4.0 * area * total
        fx += load * nx
        fy += load * ny
        fz += load * nz
        tx += my * nz - mz * ny
        ty += mz * nx - mx * nz
        tz += mx * ny - my * nx
        vn = vx * nx + vy * ny + vz * nz
        corners = select(vn >= least, corners, 0.0)
        sides[i] = int(select(corners == 3.0, 2.0, select(corners > 0.0, 1.0, 0.0)))
    add_sums(sums, weight / 12.0, fx, fy, fz, tx, ty, tz)


@kernel
def add_whole(block: Any, face: int, pieces: Any, found: int) -> int:
    """Append eight faces to the pieces; how many there are now."""
    n = int(block[STRIDE])
    at = HEADER + face
    for j in range(CENTROID + 3):
        copy_vector(place_of(pieces, found + j * PIECES), place_of(block, at + (FACES + j) * n))
    copy_vector(place_of(pieces, found + PIECE * PIECES), place_of(block, at + AREA * n))
    return found + WIDTH


@kernel
def collect(
    block: Any, motion: Any, first: int, count: int, weight: float,
    pieces: Any, found: int, cuts: Any, many: int, sums: Any,
) -> tuple[int, int]:  # fmt: skip
    """Append a run of faces over still water to the pieces and to the faces to cut; how many there are now."""
    sides = stack_doubles(RUN // WIDTH)
    words = as_words(sides)
    find_sides(block, motion, first, count, weight, as_bytes(sides), sums)
    n = int(block[STRIDE])
    for i in range(count // WIDTH):
        word = words[i]
        whole = word & EVERY_WHOLE
        if whole != 0:
            add_whole(block, first + WIDTH * i, pieces, found)
            others = whole ^ EVERY_WHOLE  # without area
            while others != 0:
                pieces[found + PIECE * PIECES + lowest_byte(others)] = 0.0
                others &= others - 1
            found += WIDTH
        word &= EVERY_CROSSED
        while word != 0:
            k = HEADER + first + WIDTH * i + lowest_byte(word)
            word &= word - 1
            for j in range(9):
                cuts[many + j * CUTS] = block[k + j * n]
            for j in range(3):
                cuts[many + (CUT_NORMAL + j) * CUTS] = block[k + (FACES + NORMAL + j) * n]
            cuts[many + CUT_AREA * CUTS] = block[k + AREA * n]
            many += 1
    return found, many


@kernel
def cut_faces(motion: Any, weight: float, cuts: Any, many: int, pieces: Any, sums: Any) -> None:
    """Write the wet pieces of the faces to cut; whole vectors, of which what fills the last has no area."""
    if many == 0:
        return
    filled = many
    while filled % WIDTH != 0:
        for j in range(CUT):
            cuts[filled + j * CUTS] = 0.0
        filled += 1
    _find_heights(motion, cuts, filled)
    for k in range(many, filled):  # a corner under water, so that there is something to cut
        cuts[k + HEIGHTS * CUTS], cuts[k + (HEIGHTS + 1) * CUTS] = -1.0, 1.0
        cuts[k + (HEIGHTS + 2) * CUTS] = 1.0
    _cut(cuts, filled, weight, pieces, sums)


@vector_kernel
def _find_heights(motion: Any, cuts: Any, count: int) -> None:
    """Heights of the corners of faces to cut above still water."""
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    for i in range(count):
        for j in range(3):
            x, y, h = (
                cuts[i + 3 * j * CUTS],
                cuts[i + (3 * j + 1) * CUTS],
                cuts[i + (3 * j + 2) * CUTS],
            )
            cuts[i + (HEIGHTS + j) * CUTS] = z + ux * x + uy * y + uz * h


@kernel
def collect_in_waves(
    block: Any, state: Any, motion: Any, patch: Any, first: int, count: int, weight: float,
    pieces: Any, found: int, sums: Any,
) -> int:  # fmt: skip
    """Append what is wet of a run of faces under a surface that moves to the pieces; how many there are now."""
    n = int(block[STRIDE])
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    fx = fy = fz = tx = ty = tz = 0.0
    for i in range(count):
        k = HEADER + first + i
        ax, ay, az = block[k], block[k + n], block[k + 2 * n]
        bx, by, bz = block[k + 3 * n], block[k + 4 * n], block[k + 5 * n]
        cx, cy, cz = block[k + 6 * n], block[k + 7 * n], block[k + 8 * n]
        ha = z + ux * ax + uy * ay + uz * az - surface_at(patch, state, ax, ay, az, 0)
        hb = z + ux * bx + uy * by + uz * bz - surface_at(patch, state, bx, by, bz, 0)
        hc = z + ux * cx + uy * cy + uz * cz - surface_at(patch, state, cx, cy, cz, 0)
        fraction, rx, ry, rz = immersed_part(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
        if fraction == 0.0:
            continue
        whole = block[k + AREA * n]
        k += FACES * n
        nx, ny, nz = block[k], block[k + n], block[k + 2 * n]
        _put(pieces, found, nx, ny, nz)
        _put(pieces, found + CENTROID * PIECES, rx, ry, rz)
        pieces[found + RISE * PIECES] = surface_at(patch, state, rx, ry, rz, 1)
        pieces[found + PIECE * PIECES] = fraction * whole
        found += 1
        if weight != 0.0:
            height, mx, my, mz = column(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
            height *= whole
            fx += height * nx
            fy += height * ny
            fz += height * nz
            tx += whole * (my * nz - mz * ny)
            ty += whole * (mz * nx - mx * nz)
            tz += whole * (mx * ny - my * nx)
    add_sums(sums, weight, fx, fy, fz, tx, ty, tz)
    return found


@vector_kernel
def _cut(cuts: Any, count: int, weight: float, pieces: Any, sums: Any) -> None:
    """The wet pieces of faces that the surface cuts, and their buoyancy."""
    fx = fy = fz = tx = ty = tz = 0.0
    for i in range(count):
        nx, ny, nz = cuts[i + 12 * CUTS], cuts[i + 13 * CUTS], cuts[i + 14 * CUTS]
        area = cuts[i + CUT_AREA * CUTS]
        fraction, rx, ry, rz, height, mx, my, mz = cut(
            cuts[i], cuts[i + CUTS], cuts[i + 2 * CUTS], cuts[i + 9 * CUTS],
            cuts[i + 3 * CUTS], cuts[i + 4 * CUTS], cuts[i + 5 * CUTS], cuts[i + 10 * CUTS],
            cuts[i + 6 * CUTS], cuts[i + 7 * CUTS], cuts[i + 8 * CUTS], cuts[i + 11 * CUTS],
        )  # fmt: skip
        _put(pieces, i, nx, ny, nz)
        _put(pieces, i + CENTROID * PIECES, rx, ry, rz)
        pieces[i + PIECE * PIECES] = fraction * area
        load = area * height
        fx += load * nx
        fy += load * ny
        fz += load * nz
        tx += area * (my * nz - mz * ny)
        ty += area * (mz * nx - mx * nz)
        tz += area * (mx * ny - my * nx)
    add_sums(sums, weight, fx, fy, fz, tx, ty, tz)


@inlined
def _put(pieces: Any, k: int, x: float, y: float, z: float) -> None:
    """Write a vector of a piece."""
    pieces[k], pieces[k + PIECES], pieces[k + 2 * PIECES] = x, y, z
