"""Natural periods of floating bodies, and how their motions die away in still water."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray

from mjskip._typing import Array
from mjskip.hydro import _radiation_kernels as kernels
from mjskip.hydro.radiation import RadiationTable, body_modes, radiation_table
from mjskip.hydro.response import FloatingBody, dof_names

RESTORED = (2, 3, 4)
"""Heave, roll and pitch: what still water restores."""
PERIODS, STEPS = 8, 100
"""Length of a decay in natural periods, and time steps of each."""


def natural_periods(data: xarray.Dataset) -> xarray.DataArray:
    """2 pi sqrt((M + A(w)) / C) of every dof by itself, at its own frequency (radiating_dof) [s].

    Infinite where nothing restores. Between the frequencies of `data` A is linear, beyond them constant.
    """
    omega = data.omega.values
    found = []
    for k in range(len(data.radiating_dof)):
        stiffness = float(data.hydrostatic_stiffness.values[k, k])
        mass = float(data.inertia_matrix.values[k, k])
        if k % 6 not in RESTORED or not stiffness > 1e-9 * mass:
            found.append(math.inf)
            continue
        added = data.added_mass.values[:, k, k]
        own = math.sqrt(stiffness / (mass + added.mean()))
        for _ in range(50):
            own = 0.5 * (own + math.sqrt(stiffness / (mass + np.interp(own, omega, added))))
        found.append(2.0 * math.pi / own)
    return xarray.DataArray(
        found,
        dims="radiating_dof",
        coords={"radiating_dof": data.radiating_dof},
        attrs={"units": "s"},
    )


def decays(
    bodies: Sequence[FloatingBody], *, density: float, gravity: float, depth: float = math.inf
) -> xarray.DataArray:
    """Heave, roll and pitch let go from 1 (m, rad), each body alone, over time (time, radiating_dof).

    Linear; the other motions are free. Other dofs are not a number.
    """
    curves: list[dict[int, Array]] = []
    longest = 0.0
    for body in bodies:
        modes = body_modes((body.hull,), depth=depth, gravity=gravity)
        table = radiation_table(body.hull, modes, density=density)
        stiffness = body.hull.stiffness(density=density, gravity=gravity, mass=body.mass)
        total = body.mass_matrix + table.added_mass
        periods = {
            k: 2.0 * math.pi * math.sqrt(total[k, k] / stiffness[k, k])
            for k in RESTORED
            if stiffness[k, k] > 1e-9 * total[k, k]
        }
        found = {k: _decay(table, total, stiffness, k, period) for k, period in periods.items()}
        longest = max([longest, *(PERIODS * p for p in periods.values())])
        curves.append(found)
    time = np.linspace(0.0, longest or 1.0, 801)
    values = np.full((len(time), 6 * len(bodies)), math.nan)
    for n, found in enumerate(curves):
        for k, curve in found.items():
            values[:, 6 * n + k] = np.interp(time, curve[0], curve[1], right=math.nan)
    return xarray.DataArray(
        values,
        dims=("time", "radiating_dof"),
        coords={"time": time, "radiating_dof": dof_names([b.name for b in bodies])},
    )


def _decay(table: RadiationTable, total: Array, stiffness: Array, dof: int, period: float) -> Array:
    """Times and positions (2, n) of one dof that is let go."""
    step, count = period / STEPS, PERIODS * STEPS
    modes, inverse = table.modes, np.linalg.inv(total)
    real, imag = np.zeros(modes.size), np.zeros(modes.size)
    harmonics, readings = np.zeros(table.starts[-1]), np.zeros(len(table.rows))
    pushed = np.zeros((2, modes.size))
    turn = np.exp(-1j * modes.frequencies * step)[modes.ring]
    turn_real, turn_imag = np.ascontiguousarray(turn.real), np.ascontiguousarray(turn.imag)
    rings = (modes.first, table.orders, table.starts, *table.turns)
    lids = table.lid_force.shape[1]
    place, velocity, path = np.zeros(6), np.zeros(6), np.empty(count + 1)
    place[dof] = path[0] = 1.0
    for n in range(count):
        kernels.gather(real, imag, *rings, 0.0, harmonics)
        kernels.read_rows(table.rows, harmonics, readings)
        force = (
            readings[:6] + table.lid_force @ readings[len(readings) - lids :] - stiffness @ place
        )
        velocity = velocity + step * inverse @ force
        place = place + step * velocity
        readings[:6] = velocity
        kernels.add_columns(table.columns, readings, harmonics)
        kernels.scatter(harmonics, *rings, 0.0, pushed[0], pushed[1])
        kernels.advance_waves(real, imag, pushed[0], pushed[1], turn_real, turn_imag, step)
        path[n + 1] = place[dof]
    return np.stack([step * np.arange(count + 1), path])
