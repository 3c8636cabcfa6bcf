"""What water and air do to a body as a row of 17 numbers, world frame: the names of its columns."""

from __future__ import annotations

from typing import NamedTuple

from mjskip._typing import Array

FORCE, TORQUE = 0, 3
"""Where the water's force [N] and its torque about the centre of mass [N m] begin (3 each)."""
AIR_FORCE, AIR_TORQUE = 6, 9
"""The same of the air."""
WRENCH = 12
"""Length of the four above."""
WETTED_AREA, WETTED_CENTRE, CLEARANCE = 12, 13, 16
"""Immersed area [m^2], where its centroid (3) [m] begins, height of the lowest point above the surface [m]."""
IMMERSION = 5
"""Length of the three above."""
LOAD = WRENCH + IMMERSION
"""Length of a row: wrench and immersion."""


class LoadColumns(NamedTuple):
    """Views of one row (17,) or of many (n, 17)."""

    force: Array
    torque: Array
    air_force: Array
    air_torque: Array
    wetted_area: Array
    wetted_centre: Array
    clearance: Array


def load_columns(rows: Array) -> LoadColumns:
    """Views: vectors (..., 3), wetted area (...) and clearance (...)."""
    return LoadColumns(
        force=rows[..., FORCE:TORQUE],
        torque=rows[..., TORQUE:AIR_FORCE],
        air_force=rows[..., AIR_FORCE:AIR_TORQUE],
        air_torque=rows[..., AIR_TORQUE:WRENCH],
        wetted_area=rows[..., WETTED_AREA],
        wetted_centre=rows[..., WETTED_CENTRE:CLEARANCE],
        clearance=rows[..., CLEARANCE],
    )
