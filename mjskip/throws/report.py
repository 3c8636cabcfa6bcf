"""The touches of a throw as rows of text, for the terminal and for the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from mjskip.throws.trajectory import Contact, Trajectory

Cell = Callable[[Contact, float], str]

COLUMNS: dict[str, tuple[str, Cell]] = {
    "time": ("s", lambda c, _: f"{c.entry.time:.3f}"),
    "distance": ("m", lambda _, distance: f"{distance:.2f}"),
    "in": ("m/s", lambda c, _: f"{c.entry.speed:.2f}"),
    "out": ("m/s", lambda c, _: f"{c.exit.speed:.2f}" if c.exit else "-"),
    "attack": ("deg", lambda c, _: f"{math.degrees(c.entry.attack):.1f}"),
    "bank": ("deg", lambda c, _: f"{math.degrees(c.entry.bank):.1f}"),
    "depth": ("mm", lambda c, _: f"{1e3 * c.depth:.1f}"),
    "contact": (
        "ms", lambda c, _: f"{1e3 * (c.exit.time - c.entry.time):.1f}" if c.exit else "stayed",
    ),
    "airtime": ("ms", lambda c, _: f"{1e3 * c.airtime:.0f}" if c.exit else "-"),
}  # fmt: skip
"""Heading: unit, and the text of a touch that many metres from the release."""


def skip_rows(run: Trajectory, columns: Sequence[str] = tuple(COLUMNS)) -> list[list[str]]:
    """The chosen columns of every touch, its number first."""
    rows = []
    for number, contact in enumerate(run.contacts, 1):
        distance = math.dist(contact.entry.position[:2], run.position[0, :2])
        rows.append([str(number), *(COLUMNS[name][1](contact, distance) for name in columns)])
    return rows
