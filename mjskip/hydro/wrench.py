"""Forces of water and air on a stone in a given pose and motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import types

from mjskip._compile.jit import native
from mjskip._compile.pointers import F8P, address_of_cfunc
from mjskip._typing import Array
from mjskip.checks import check_type, check_vector
from mjskip.hydro import _wrench_kernels as kernels
from mjskip.hydro.columns import LOAD, load_columns
from mjskip.hydro.hull import Hull
from mjskip.hydro.packing import pack as pack
from mjskip.hydro.water import Water
from mjskip.rigid.attitude import matrices
from mjskip.rigid.state import pack_states


@dataclass(frozen=True, kw_only=True)
class Wrench:
    """Forces on a stone, torques about its centre of mass, in the world frame.

    Attributes:
        force: of the water (3,) [N].
        torque: of the water (3,) [N m].
        air_force: of the air (3,) [N].
        air_torque: of the air (3,) [N m].
        wetted_area: immersed area of the surface, loaded or not [m^2].
        wetted_centre: centroid of that surface (3,) [m]; the centre of mass when dry.
        clearance: height of the lowest point above still water [m]; negative when wet.
    """

    force: Array
    torque: Array
    air_force: Array
    air_torque: Array
    wetted_area: float
    wetted_centre: Array
    clearance: float


def wrench(
    stone: Hull,
    water: Water | None = None,
    *,
    position: npt.ArrayLike,
    q: npt.ArrayLike = (1.0, 0.0, 0.0, 0.0),
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    omega: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> Wrench:
    """Force and torque of still water (z = 0) and of air on a stone at one moment.

    Args:
        stone: the body.
        water: the fluid; `Water()` if omitted.
        position: of the centre of mass, world (3,) [m].
        q: orientation (4,), w-x-y-z, body to world; any length but zero.
        velocity: of the centre of mass, world (3,) [m/s].
        omega: angular velocity, world (3,) [rad/s].

    Returns:
        The wrench. Equations (1)-(4) of Lee & Baek (2010), or the law that `water` names.

    Raises:
        ValueError: an argument has the wrong shape or is not finite, or q is zero.
    """
    x, v, w = (
        check_vector(n, a, 3)
        for n, a in (("position", position), ("velocity", velocity), ("omega", omega))
    )
    q = check_vector("q", q, 4)
    if not np.linalg.norm(q) > 0.0:
        raise ValueError("q is zero: give a quaternion (w, x, y, z) of any length but zero")
    states = pack_states(x[None], matrices(q)[None], v[None], w[None])
    check_type("stone", stone, Hull)
    water = Water() if water is None else check_type("water", water, Water)
    return wrench_of(pack(stone, water), states)


def wrench_of(block: Array, states: Array) -> Wrench:
    """The same for a packed stone and the first of its packed states."""
    row = load_columns(wrench_and_immersion(block, states[:1])[0])._asdict()
    row |= {"wetted_area": float(row["wetted_area"]), "clearance": float(row["clearance"])}
    return Wrench(**row)


def wrench_and_immersion(block: Array, states: Array) -> Array:
    """Rows (n, 17) of every state (n, 18); see `mjskip.hydro.columns`."""
    out = np.empty((len(states), LOAD))
    kernels.wrench_and_immersion(wrench_address(), immersion_address(), block, states, out)
    return out


def wrench_address() -> int:
    """Address of the compiled kernel, void(block*, state*, out*): what both engines call."""
    return entry_address(kernels._entry)


def immersion_address() -> int:
    """The same for the five numbers that `wrench_and_immersion` adds to the wrench."""
    return entry_address(kernels._immersion_entry)


@cache
def entry_address(function: Callable[[Any, Any, Any], None]) -> int:
    """Address of a function compiled as void(double*, double*, double*)."""
    compiled = native(types.void(F8P, F8P, F8P))(function)
    _alive.append(compiled)
    return address_of_cfunc(compiled)


_alive: list[object] = []
"""Compiled C functions, kept for the life of the process: others hold their addresses."""
