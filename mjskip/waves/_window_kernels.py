"""A square of water that waves leave: its elevation and the potential at its surface.

    phi_t = -(g - (sigma / rho) lap) z - p / rho - nu phi,   z_t = G phi
    phi[n+1/2] = a phi[n-1/2] - b dt (g z[n] - (sigma / rho) lap z[n]) - b0 dt p / rho
    z[n+1] = z[n] + dt G phi[n+1/2],   a = (1 - nu dt / 2) / (1 + nu dt / 2),   b = 1 / (1 + nu dt / 2)

    waves  G = -(c^2 / g) lap, nine-point;  nu = mu is then the damping of equation (5) of Lee & Baek
    deep   G = |k| tanh(|k| H), by FFT

nu grows from mu towards the edges, where it damps the potential only: the mean of z, which G leaves alone, stays,
so no volume is made. b0 is b without that growth. The square is periodic: a wave has to pass two edges.

*water* holds what does not change, *state* what does, both flat; the constants say where. The first cell of the
square is cell (FIRST_I, FIRST_J) of a grid without end whose cell (0, 0) has its centre at (0, 0).
"""

import math
from typing import Any

import numpy as np
from rocket_fft import c2r, r2c

from mjskip._compile.jit import kernel

# water
CELLS, SPACING, GRAVITY, DENSITY, DAMPING = 0, 1, 2, 3, 4
STIFFNESS = 5  # sigma / rho [m^3/s^2]
STENCIL = 6  # c^2 / (6 g d^2) of `waves` [1/m], 0: `deep`
TAPER = 8
"""Cells over which the water fades at the end of the square that moves away."""

WATER = 7  # then growth of nu against the distance from an edge (n,), and the symbol of G (n, n // 2 + 1)

# state
FIRST_I, FIRST_J = 0, 1
LEFT_VOLUME, LEFT_ENERGY = 2, 3  # what shifts have left behind [m^3, J]
STATE = 4  # then level z[n], potential phi[n-1/2] and rate G phi[n-1/2], (n, n) each


@kernel
def plane(state: Any, cells: int, which: int) -> Any:
    """Level (0), potential (1) or rate (2) of a state, as an array."""
    size = cells * cells
    return state[STATE + which * size : STATE + (which + 1) * size].reshape((cells, cells))


@kernel
def apply_operator(water: Any, field: Any, out: Any) -> None:
    """out = G field."""
    n = field.shape[0]
    if water[STENCIL] > 0.0:
        nine_point(field, -water[STENCIL], out)
        return
    half = n // 2 + 1
    symbol = water[WATER + n : WATER + n + n * half].reshape((n, half))
    multiply_spectrum(field, symbol, out)


@kernel
def multiply_spectrum(field: Any, symbol: Any, out: Any) -> None:
    """out = F^-1 symbol F field."""
    n, half = symbol.shape
    axes = np.array([0, 1])
    spectrum = np.empty((n, half), np.complex128)
    r2c(field, spectrum, axes, True, 1.0, 1)
    scale = 1.0 / (n * n)
    for i in range(n):
        for j in range(half):
            spectrum[i, j] *= scale * symbol[i, j]
    c2r(spectrum, out, axes, False, 1.0, 1)


@kernel
def nine_point(field: Any, scale: float, out: Any) -> None:
    """out = scale [1 4 1; 4 -20 4; 1 4 1] field, periodic."""
    n = field.shape[0]
    for i in range(n):
        below, here, above = (
            field[i - 1 if i > 0 else n - 1],
            field[i],
            field[i + 1 if i + 1 < n else 0],
        )
        line = out[i]
        for j in range(1, n - 1):
            line[j] = scale * (
                (below[j - 1] + below[j + 1] + above[j - 1] + above[j + 1])
                + 4.0 * (below[j] + above[j] + here[j - 1] + here[j + 1])
                - 20.0 * here[j]
            )
        for j in (0, n - 1):
            west, east = (j - 1 if j > 0 else n - 1), (j + 1 if j + 1 < n else 0)
            line[j] = scale * (
                (below[west] + below[east] + above[west] + above[east])
                + 4.0 * (below[j] + above[j] + here[west] + here[east])
                - 20.0 * here[j]
            )


@kernel
def relax(water: Any, state: Any, timestep: float) -> None:
    """phi = a phi - b dt (g z - (sigma / rho) lap z): the potential after a step without loads."""
    n = int(water[CELLS])
    level, potential = plane(state, n, 0), plane(state, n, 1)
    gravity, damping, half = water[GRAVITY], water[DAMPING], 0.5 * timestep
    pull = level
    if water[STIFFNESS] > 0.0:
        pull = tension_pull(water, level)
    for i in range(n):
        edge = water[WATER + i]
        line, z = potential[i], pull[i]
        if edge == 0.0:  # most rows: only their ends differ
            for j in range(n):
                m = half * (damping + water[WATER + j])
                b = 1.0 / (1.0 + m)
                line[j] = b * ((1.0 - m) * line[j] - timestep * gravity * z[j])
        else:
            for j in range(n):
                m = half * (damping + max(edge, water[WATER + j]))
                b = 1.0 / (1.0 + m)
                line[j] = b * ((1.0 - m) * line[j] - timestep * gravity * z[j])


@kernel
def tension_pull(water: Any, level: Any) -> Any:
    """z + sigma / (rho g) k^2 z."""
    n = level.shape[0]
    symbol = np.empty((n, n // 2 + 1))
    unit = 2.0 * math.pi / (n * water[SPACING])
    for i in range(n):
        for j in range(n // 2 + 1):
            k2 = (min(i, n - i) ** 2 + j * j) * unit * unit
            symbol[i, j] = 1.0 + water[STIFFNESS] / water[GRAVITY] * k2
    out = np.empty((n, n))
    multiply_spectrum(level, symbol, out)
    return out


@kernel
def press(water: Any, state: Any, pressure: Any, timestep: float) -> None:
    """phi -= b0 dt p / rho, after `relax`."""
    n = int(water[CELLS])
    potential = plane(state, n, 1)
    scale = timestep / (water[DENSITY] * (1.0 + 0.5 * timestep * water[DAMPING]))
    for i in range(n):
        for j in range(n):
            potential[i, j] -= scale * pressure[i, j]


@kernel
def flow(water: Any, state: Any, timestep: float) -> None:
    """z += dt G phi, and rate = G phi."""
    n = int(water[CELLS])
    level, potential, rate = plane(state, n, 0), plane(state, n, 1), plane(state, n, 2)
    apply_operator(water, potential, rate)
    for i in range(n):
        line, speed = level[i], rate[i]
        for j in range(n):
            line[j] += timestep * speed[j]


@kernel
def centred_rate(water: Any, state: Any, timestep: float, work: Any, out: Any) -> None:
    """(z_free[n+1] - z[n-1]) / (2 dt) = G (phi_free[n+1/2] + phi[n-1/2]) / 2 into out.

    Args:
        water, state: not altered.
        timestep: of the coming step [s].
        work: as large as a state.
        out: (n, n).
    """
    n = int(water[CELLS])
    work[:] = state
    relax(water, work, timestep)
    mean, before = plane(work, n, 1), plane(state, n, 1)
    for i in range(n):
        for j in range(n):
            mean[i, j] = 0.5 * (mean[i, j] + before[i, j])
    apply_operator(water, mean, out)


@kernel
def _kept(place: int, way: int, cells: int) -> float:
    """What a shift leaves of a cell, by its new place along the way: all, but at the end that moves away.

    In steady motion the water fades over TAPER cells there: w(place) = sin^2, the ratio of new w and old.
    """
    behind = place if way > 0 else cells - 1 - place
    if way == 0 or behind >= TAPER:
        return 1.0
    before = min(behind + abs(way), TAPER)
    quarter = 0.5 * math.pi / (TAPER + 1)
    kept: float = (math.sin(quarter * (behind + 1)) / math.sin(quarter * (before + 1))) ** 2
    return kept


@kernel
def shift(water: Any, state: Any, di: int, dj: int) -> None:
    """Move the square by whole cells: still water comes in, what goes out is counted as left behind.

    The rate is moved with the rest; G phi of the square as it is now differs a little from it.
    """
    n = int(water[CELLS])
    if di == 0 and dj == 0:
        return
    level, potential, rate = plane(state, n, 0), plane(state, n, 1), plane(state, n, 2)
    area = water[SPACING] * water[SPACING]
    volume, energy = 0.0, 0.0
    for i in range(n):
        for j in range(n):
            volume += level[i, j]
            energy += water[GRAVITY] * level[i, j] ** 2 + potential[i, j] * rate[i, j]
    for a in range(n):
        i = a if di >= 0 else n - 1 - a
        along = _kept(i, di, n)
        for b in range(n):
            j = b if dj >= 0 else n - 1 - b
            inside = 0 <= i + di < n and 0 <= j + dj < n
            kept = along * _kept(j, dj, n) if inside else 0.0
            level[i, j] = kept * level[i + di, j + dj] if inside else 0.0
            potential[i, j] = kept * potential[i + di, j + dj] if inside else 0.0
            rate[i, j] = kept * rate[i + di, j + dj] if inside else 0.0
            volume -= level[i, j]
            energy -= water[GRAVITY] * level[i, j] ** 2 + potential[i, j] * rate[i, j]
    state[LEFT_VOLUME] += area * volume
    state[LEFT_ENERGY] += 0.5 * water[DENSITY] * area * energy
    state[FIRST_I] += di
    state[FIRST_J] += dj


@kernel
def follow(water: Any, state: Any, x: float, y: float) -> None:
    """Move the square so that its middle is within a cell of a place [m]."""
    n = int(water[CELLS])
    middle = 0.5 * (n - 1)
    gap_i = x / water[SPACING] - state[FIRST_I] - middle
    gap_j = y / water[SPACING] - state[FIRST_J] - middle
    if not (abs(gap_i) < 1e15 and abs(gap_j) < 1e15):
        return
    di = int(np.rint(gap_i)) if abs(gap_i) > 1.0 else 0
    dj = int(np.rint(gap_j)) if abs(gap_j) > 1.0 else 0
    shift(water, state, di, dj)
