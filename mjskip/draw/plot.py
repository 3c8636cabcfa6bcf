"""One page about a throw, or several on one another: path, speed, attitude and energy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mjskip._typing import Array, Flags
from mjskip.errors import MjskipError
from mjskip.files import whole_file
from mjskip.rigid.attitude import angles, matrices
from mjskip.throws.trajectory import Trajectory

SUFFIXES = (".png", ".svg", ".pdf")

_COLOURS = ("#1f6f8b", "#d1603d", "#5b8c3a", "#7d5ba6", "#c9a227", "#555555")
_WET = "#9fd3e6"


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyBudget:
    """Where the energy of a throw is, (n,) each [J]; their sum stays what it was at first.

    Attributes:
        motion: kinetic energy of the centre of mass.
        turning: kinetic energy about it.
        potential: m g z.
        water: given to the water so far: minus the work of its force and torque.
        air: given to the air so far.
    """

    motion: Array
    turning: Array
    potential: Array
    water: Array
    air: Array

    @property
    def total(self) -> Array:
        """The sum (n,) [J]."""
        return self.motion + self.turning + self.potential + self.water + self.air


def energy_budget(run: Trajectory) -> EnergyBudget:
    """Where the energy of a throw is, from its recorded forces by the trapezium rule."""
    by_water = np.sum(run.force * run.velocity + run.torque * run.omega, axis=1)
    by_air = np.sum(run.air_force * run.velocity, axis=1)
    step = np.diff(run.time)

    def spent(power: Array) -> Array:
        work = np.cumsum(0.5 * (power[1:] + power[:-1]) * step)
        return -np.concatenate([[0.0], work])

    return EnergyBudget(
        motion=0.5 * np.sum(run.P * run.velocity, axis=1),
        turning=0.5 * np.sum(run.L * run.omega, axis=1),
        potential=run.potential_energy,
        water=spent(by_water),
        air=spent(by_air),
    )


def tilts(run: Trajectory) -> tuple[Array, Array]:
    """Attack and bank (n,) [rad].

    The stone's face is known from how it was thrown; a stone without a recorded throw is taken to be
    flat across its z axis.
    """
    face = np.array([0.0, 0.0, 1.0])
    throw = run.attributes.get("throw")
    if isinstance(throw, Mapping) and {"attack", "bank"} <= set(throw):
        back, left = -math.sin(throw["attack"]), math.sin(throw["bank"])
        normal = np.array([back, left, math.sqrt(max(0.0, 1.0 - back * back - left * left))])
        face = matrices(run.q[0]).T @ normal
    found = angles(matrices(run.q) @ face, run.velocity, run.omega)
    return found.attack, found.bank


def plot_runs(runs: Mapping[str, Trajectory], path: str | Path) -> Path:
    """Write a page about one throw or several.

    Args:
        runs: the trajectories by the names that the legend gives them.
        path: .png, .svg or .pdf.

    Raises:
        MjskipError: matplotlib is not installed, or the file cannot be written.
        ValueError: no runs, or a name that ends otherwise.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"plot name {path} ends in {path.suffix!r}: use {', '.join(SUFFIXES)}")
    if not runs:
        raise ValueError("no runs: give at least one to plot")
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MjskipError("plots need matplotlib: pip install 'mjskip[plot]'") from error
    style: Any = {
        "font.size": 12, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
        "grid.alpha": 0.3, "lines.linewidth": 2.0, "axes.titlesize": 13, "axes.titlelocation": "left",
        "svg.hashsalt": "mjskip",
    }  # fmt: skip
    with rc_context(style):
        figure = Figure(figsize=(11.7, 12.6), layout="constrained")
        panels = figure.subplot_mosaic(
            [["side", "side"], ["top", "top"], ["speed", "momentum"], ["tilt", "spin"], ["energy", "energy"]],
            height_ratios=[1.0, 0.8, 1.0, 1.0, 1.3],
        )  # fmt: skip
        for number, (name, run) in enumerate(runs.items()):
            _draw_run(panels, run, name, _COLOURS[number % len(_COLOURS)], alone=len(runs) == 1)
        _energy(panels["energy"], runs)
        _label(panels)
        figure.suptitle(_title(runs), fontsize=15)
        if len(runs) > 1:
            panels["side"].legend(loc="upper right", ncols=min(len(runs), 3), frameon=False)
        meta = {"Date": None} if path.suffix.lower() == ".svg" else {}
        with whole_file(path) as part:
            figure.savefig(part, dpi=110, format=path.suffix.lower()[1:], metadata=meta)
    return path


def _draw_run(panels: Any, run: Trajectory, name: str, colour: str, *, alone: bool) -> None:
    start = run.position[0]
    along, across, height = (run.position - start * [1.0, 1.0, 0.0]).T
    wet = run.clearance < 0.0
    panels["side"].plot(along, 100.0 * height, color=colour, label=name)
    panels["top"].plot(along, 100.0 * across, color=colour)
    for contact in run.contacts:
        at = np.array(contact.entry.position) - start * [1.0, 1.0, 0.0]
        panels["side"].plot(at[0], 0.0, "o", mfc="white", mec=colour, ms=8, mew=2, zorder=5)
        panels["top"].plot(at[0], 100.0 * at[1], "o", mfc="white", mec=colour, ms=8, mew=2)
    attack, bank = tilts(run)
    panels["speed"].plot(run.time, np.linalg.norm(run.velocity, axis=1), color=colour)
    panels["momentum"].plot(run.time, run.P[:, 0], color=colour)
    panels["momentum"].plot(run.time, run.P[:, 2], color=colour, ls="--")
    panels["tilt"].plot(run.time, _without_jumps(np.degrees(attack)), color=colour)
    panels["tilt"].plot(run.time, np.degrees(bank), color=colour, ls="--")
    turning = np.linalg.norm(run.omega, axis=1) / (2.0 * math.pi)
    panels["spin"].plot(run.time, turning, color=colour)
    if alone:
        for key in ("speed", "momentum", "tilt", "spin"):
            for first, last in _spans(wet):
                panels[key].axvspan(run.time[first], run.time[last], color=_WET, alpha=0.5, lw=0)


def _without_jumps(angle: Array) -> Array:
    """An angle [degrees] with gaps where it leaps from -90 to 90: nothing turned there but its name."""
    leaps = np.abs(np.diff(angle, prepend=angle[0])) > 90.0
    return np.where(leaps, np.nan, angle)


def _spans(wet: Flags) -> list[tuple[int, int]]:
    """First and last row of every stretch that is wet."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], wet.astype(np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _energy(panel: Any, runs: Mapping[str, Trajectory]) -> None:
    """Layers of one run; of several, what is left and what the water took."""
    if len(runs) == 1:
        (run,) = runs.values()
        budget = energy_budget(run)
        floor = min(float(budget.potential.min()), 0.0)
        panel.stackplot(
            run.time, budget.motion, budget.turning, budget.potential - floor, budget.water, budget.air,
            labels=["flight", "spin", "height", "given to water", "given to air"],
            colors=["#1f6f8b", "#7d5ba6", "#8fb06a", "#9fd3e6", "#d9d9d9"],
        )  # fmt: skip
        panel.legend(loc="lower left", ncols=5, frameon=True, framealpha=0.9)
        panel.set_title("Energy (height counted from the lowest point)")
        panel.set_xlim(run.time[0], run.time[-1])
        return
    for number, run in enumerate(runs.values()):
        budget = energy_budget(run)
        colour = _COLOURS[number % len(_COLOURS)]
        panel.plot(run.time, budget.motion + budget.turning + budget.potential, color=colour)
        panel.plot(run.time, budget.water, color=colour, ls="--")
        panel.plot(run.time, budget.air, color=colour, ls=":")
    panel.set_title("Energy of the stone (solid), given to water (dashed), to air (dotted)")


def _label(panels: Any) -> None:
    for key, title, horizontal, vertical in (
        ("side", "Path from the side (circles: touches)", "distance [m]", "height [cm]"),
        ("top", "Path from above", "distance [m]", "to the left [cm]"),
        ("speed", "Speed", "time [s]", "[m/s]"),
        ("momentum", "Momentum: forward (solid), up (dashed)", "time [s]", "[kg m/s]"),
        ("tilt", "Attack (solid), bank (dashed)", "time [s]", "[degrees]"),
        ("spin", "Rate of turning", "time [s]", "[rev/s]"),
    ):
        panels[key].set(xlabel=horizontal, ylabel=vertical, title=title)
    panels["spin"].set_ylim(bottom=0.0)
    panels["energy"].set(xlabel="time [s]", ylabel="[J]")
    panels["side"].axhline(0.0, color=_WET, lw=3, zorder=0)
    low, high = panels["top"].get_ylim()
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 2.0)
    panels["top"].set_ylim(middle - half, middle + half)  # a straight path shows as one


def _title(runs: Mapping[str, Trajectory]) -> str:
    if len(runs) > 1:
        return " · ".join(f"{name}: {_skips(run)}" for name, run in runs.items())
    (run,) = runs.values()
    throw = run.attributes.get("throw")
    text = f"{run.attributes.get('body', 'stone')}: {_skips(run)}"
    if (
        isinstance(throw, Mapping)
        and "speed" in throw
        and run.attributes.get("frozen_attitude") is not True
    ):
        text += (
            f" — {throw['speed']:.3g} m/s, {throw['spin'] / (2.0 * math.pi):.3g} rev/s, "
            f"attack {math.degrees(throw['attack']):.3g}°, descent {math.degrees(throw['descent']):.3g}°"
        )
    return text


def _skips(run: Trajectory) -> str:
    return f"{run.skips} skip{'' if run.skips == 1 else 's'}, {run.end}"
