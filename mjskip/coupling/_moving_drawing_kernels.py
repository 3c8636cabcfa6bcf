"""Moving water and forces in MuJoCo's own scenes: what every viewer and `mujoco.Renderer` then show.

A surface is a graded grid of translucent triangles, with still water round it; a force is an arrow from the centre of
mass. Geoms are added as long as the scene has room.
"""

import ctypes
import math
from typing import Any

import numpy as np
from llvmlite import binding
from numba import types

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, as_doubles, as_ints, as_words, stack_doubles
from mjskip.coupling import _plugin_kernels as plugin
from mjskip.coupling._moving_kernels import (
    ARROWS,
    INSTANCE,
    RECORDS,
    SCENE,
    WATER_SIZE,
    couple,
    gather,
    state_of,
    timestep_of,
    water_of,
)
from mjskip.coupling._struct_layout import library
from mjskip.waves import _window_kernels as window

GEOM_TRIANGLE, GEOM_ARROW = 108, 100  # mjtGeom
DATAID, OBJID, CATEGORY, MATID, TEXID, SEGID = 1, 3, 4, 5, 6, 9
"""Places of whole numbers at the beginning of an mjvGeom."""
DECOR = 4  # mjtCatBit

binding.add_symbol("mjv_initGeom", ctypes.cast(library.mjv_initGeom, ctypes.c_void_p).value)
i4, i8 = types.int32, types.int64
mjv_initGeom = types.ExternalFunction("mjv_initGeom", types.void(i8, i4, i8, i8, i8, i8))

MAX_TRIANGLES = 4000
"""Of a drawn surface."""
SKIRT = 8.0
"""Half width of the still water that is drawn round the window, in half widths of that."""


@kernel
def _nodes(cells: int, stride: int, out: Any) -> int:
    """Places of grid lines in cells: every `stride` in the middle half, four times as far outside, and the skirt."""
    count = 1
    middle = 0.5 * (cells - 1)
    out[0] = middle - SKIRT * middle
    place = 0.0
    while place < cells - 1:
        out[count] = place
        count += 1
        inside = 0.25 * cells <= place < 0.75 * cells
        place += stride if inside else 4 * stride
    out[count] = cells - 1
    out[count + 1] = middle + SKIRT * middle
    return count + 2


@kernel
def _next_geom(table: Any, scene: int) -> Any:
    """Address of a free geom of the scene, which is counted; 0 if there is none."""
    count = as_ints(scene + table[plugin.SCENE_NGEOM])
    if count[0] >= as_ints(scene + table[plugin.SCENE_MAXGEOM])[0]:
        return 0
    geom = as_words(scene + table[plugin.SCENE_GEOMS])[0] + table[plugin.GEOM_BYTES] * count[0]
    count[0] += 1
    numbers = as_ints(geom)
    for n in range(table[plugin.GEOM_BYTES] // 4):  # mjv_initGeom leaves some as the memory was
        numbers[n] = 0
    numbers[DATAID] = numbers[OBJID] = numbers[MATID] = numbers[TEXID] = numbers[SEGID] = -1
    numbers[CATEGORY] = DECOR
    return geom


@kernel
def _draw_triangle(
    table: Any, scene: int, rgba: int, size_at: int, pos_at: int, mat_at: int,
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, cx: float, cy: float, cz: float,
) -> None:  # fmt: skip
    """Triangle a, b, c: MuJoCo's has corners at the origin and at one on the first and second axes."""
    geom = _next_geom(table, scene)
    if geom == 0:
        return
    sizes, pos, mat = as_doubles(size_at), as_doubles(pos_at), as_doubles(mat_at)
    sizes[0] = sizes[1] = sizes[2] = 1.0
    pos[0], pos[1], pos[2] = ax, ay, az
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    mat[0], mat[1], mat[2] = ux, vx, nx / norm
    mat[3], mat[4], mat[5] = uy, vy, ny / norm
    mat[6], mat[7], mat[8] = uz, vz, nz / norm
    mjv_initGeom(geom, GEOM_TRIANGLE, size_at, pos_at, mat_at, rgba)


@kernel
def _draw_arrow(
    table: Any, scene: int, rgba: int, size_at: int, pos_at: int, mat_at: int, state: Any, wrench: Any,
    scale: float,
) -> None:  # fmt: skip
    """Force of water and air on a body, from its centre of mass."""
    fx, fy, fz = wrench[0] + wrench[6], wrench[1] + wrench[7], wrench[2] + wrench[8]
    force = math.sqrt(fx * fx + fy * fy + fz * fz)
    if not 0.0 < force * scale < 1e3:
        return
    geom = _next_geom(table, scene)
    if geom == 0:
        return
    sizes, pos, mat = as_doubles(size_at), as_doubles(pos_at), as_doubles(mat_at)
    sizes[0] = sizes[1] = min(0.02 * force * scale + 0.001, 0.01)
    sizes[2] = force * scale
    pos[0], pos[1], pos[2] = state[0], state[1], state[2]
    zx, zy, zz = fx / force, fy / force, fz / force
    # any two axes across
    px, py, pz = (0.0, 0.0, 1.0) if abs(zz) < 0.9 else (1.0, 0.0, 0.0)
    xx, xy, xz = py * zz - pz * zy, pz * zx - px * zz, px * zy - py * zx
    norm = math.sqrt(xx * xx + xy * xy + xz * xz)
    xx, xy, xz = xx / norm, xy / norm, xz / norm
    mat[0], mat[1], mat[2] = xx, zy * xz - zz * xy, zx
    mat[3], mat[4], mat[5] = xy, zz * xx - zx * xz, zy
    mat[6], mat[7], mat[8] = xz, zx * xy - zy * xx, zz
    mjv_initGeom(geom, GEOM_ARROW, size_at, pos_at, mat_at, rgba)


@kernel
def _draw_surface(table: Any, scene: int, water: Any, state: Any, rgba: int, numbers: int) -> None:
    """The surface as translucent triangles on a graded grid, as fine as half of the free geoms allows."""
    cells = int(water[window.CELLS])
    level = window.plane(state, cells, 0)
    spacing = water[window.SPACING]
    x0, y0 = state[window.FIRST_I] * spacing, state[window.FIRST_J] * spacing
    lines = np.empty(2 * cells + 8)
    free = (
        as_ints(scene + table[plugin.SCENE_MAXGEOM])[0]
        - as_ints(scene + table[plugin.SCENE_NGEOM])[0]
    )
    stride, count = 1, _nodes(cells, 1, lines)
    while 2 * (count - 1) * (count - 1) > min(free // 2, MAX_TRIANGLES) and stride < cells:
        stride += 1
        count = _nodes(cells, stride, lines)
    if 2 * (count - 1) * (count - 1) > free:
        return
    heights = np.zeros((count, count))
    for a in range(1, count - 1):
        for b in range(1, count - 1):
            heights[a, b] = level[int(lines[a]), int(lines[b])]
    for a in range(count - 1):
        xa, xb = x0 + spacing * lines[a], x0 + spacing * lines[a + 1]
        for b in range(count - 1):
            ya, yb = y0 + spacing * lines[b], y0 + spacing * lines[b + 1]
            _draw_triangle(
                table, scene, rgba, numbers, numbers + 24, numbers + 48,
                xa, ya, heights[a, b], xb, ya, heights[a + 1, b], xb, yb, heights[a + 1, b + 1],
            )  # fmt: skip
            _draw_triangle(
                table, scene, rgba, numbers, numbers + 24, numbers + 48,
                xa, ya, heights[a, b], xb, yb, heights[a + 1, b + 1], xa, yb, heights[a, b + 1],
            )  # fmt: skip


def moving_draw(model: int, data: int, arguments: int) -> None:
    """Put the surface, and arrows if they are asked for, into a scene."""
    table = as_words(plugin.root_address())
    words = as_words(arguments)
    instance, surface, scene = words[INSTANCE], words[RECORDS], words[SCENE]
    scratch = stack_doubles(plugin.LOAD_SCRATCH)
    numbers = stack_doubles(16)
    described = as_doubles(surface)
    rgba = np.empty(4, np.float32)
    moving = described[WATER_SIZE] > 0.0
    if described[ARROWS] > 0.0:
        ids, states, wrenches = gather(table, model, data, instance, False, scratch)
        if moving:
            water = water_of(surface)
            state = state_of(table, model, data, instance, int(water[window.CELLS]))
            couple(surface, state, ids, states, wrenches, timestep_of(table, model))
        rgba[0], rgba[1], rgba[2], rgba[3] = 0.9, 0.35, 0.1, 1.0
        for b in range(ids.shape[0]):
            _draw_arrow(
                table, scene, address_of(rgba), numbers, numbers + 24, numbers + 48,
                states[b], wrenches[b], described[ARROWS],
            )  # fmt: skip
    if moving:
        water = water_of(surface)
        state = state_of(table, model, data, instance, int(water[window.CELLS]))
        rgba[0], rgba[1], rgba[2], rgba[3] = 0.25, 0.55, 0.75, 0.6
        _draw_surface(table, scene, water, state, address_of(rgba), numbers)
