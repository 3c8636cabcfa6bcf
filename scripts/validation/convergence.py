"""How fast do the engines converge, and how large may a time step be?

Position, attitude and exit speed against the adaptive yardstick (DOP853, rtol 1e-10), both engines, in
flight and through a touch; exit speed of several stones and throws against time step x speed / thickness.
40 s short, 2 min full.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _common import LEFT, in_parallel, main, picture, reference_scene, table

from mjskip import Limits, Stone, Throw, Water, integrate, load_scene, simulate
from mjskip.errors import DivergedError
from mjskip.throws.comparison import LADDER, compare, observed_order
from mjskip.throws.simulate import STEP_FRACTION

TITLE = "Convergence, and the time step it asks for"

ENOUGH = 0.01
"""Accepted error of the exit velocity, as a share of the entry speed."""

FLOOR = 5e-5
"""Errors of an exit speed below this are those of finding the moment of exit between rows [m/s]."""

FRACTIONS = (2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.125, 0.0625)
SOLVERS = (
    ("mujoco", "Euler"),
    ("mujoco", "implicitfast"),
    ("mujoco", "RK4"),
    ("reference", "euler"),
    ("reference", "midpoint"),
    ("reference", "rk4"),
)
COLOURS = dict(
    zip(SOLVERS, ("#d9822b", "#e3c14a", "#1f5fa8", "#8d4a9e", "#2e8b57", "#111111"), strict=True)
)

THROWS: dict[str, tuple[str, dict[str, float]]] = {
    "Clanet's disc, 3.5 m/s, 20/20, 100 rev/s": (
        "clanet", {"speed": 3.5, "spin": 100, "attack": 20, "descent": 20}),
    "Clanet's disc, 5 m/s, 30/15, 65 rev/s": (
        "clanet", {"speed": 5, "spin": 65, "attack": 30, "descent": 15}),
    "100 g, R 5 cm, 8 m/s, 20/10, 40 rev/s": (
        "hand", {"speed": 8, "spin": 40, "attack": 20, "descent": 10}),
    "11-gon 97 g, 12 m/s, 30/5, 48 rev/s": (
        "flat", {"speed": 12, "spin": 48, "attack": 30, "descent": 5}),
    "pebble of the lake, 11 m/s, 20/9, 20 rev/s": (
        "lake", {"speed": 11, "spin": 20, "attack": 20, "descent": 9}),
    "round pebble 5 g, 8 m/s, 20/5, 64 rev/s": (
        "round", {"speed": 8, "spin": 64, "attack": 20, "descent": 5}),
}  # fmt: skip


def stone(name: str) -> Stone:
    """The stones of THROWS."""
    return {
        "clanet": lambda: Stone.disc(0.025, 0.00275, density=2700.0),
        "hand": lambda: Stone.disc(0.05, 0.005, mass=0.1),
        "flat": lambda: Stone.disc(0.05, 0.005, segments=11, mass=0.097),
        "lake": Stone.pebble,
        "round": lambda: Stone.lens(0.01, 0.012, segments=16, rings=4),
    }[name]()


def exit_velocity(body: Stone, throw: Throw, method: str, timestep: float) -> Any:
    """Velocity (3,) as the stone leaves the first touch; nan if it stays."""
    try:
        contact = integrate(
            body,
            throw,
            water=Water(air_density=0.0),
            integrator=method,  # type: ignore[arg-type]
            timestep=timestep,
            limits=Limits(duration=0.12, min_airtime=LEFT),
        ).contacts[0]
    except DivergedError:
        return np.full(3, np.nan)
    return np.array(contact.exit.velocity) if contact.exit else np.full(3, np.nan)


def exit_errors(name: str) -> dict[str, Any]:
    """Errors of one throw's exit velocity [entry speeds] by method and fraction of thickness/speed."""
    kind, settings = THROWS[name]
    body = stone(kind)
    throw = Throw.from_degrees(**settings, height=0.0)
    unit = body.thickness / throw.speed
    truth = exit_velocity(body, throw, "adaptive", 0.05 * unit)
    found: dict[str, Any] = {"throw": name, "exit": truth, "thickness": body.thickness}
    for method in ("euler", "midpoint", "rk4"):
        found[method] = [
            float(np.linalg.norm(exit_velocity(body, throw, method, f * unit) - truth))
            / throw.speed
            for f in FRACTIONS
        ]
    return found


SCENES: dict[str, tuple[str, dict[str, float]]] = {
    "Clanet's disc, 3.5 m/s, 20/20, 100 rev/s": (
        "clanet_disc", {"speed": 3.5, "spin": 100, "attack": 20, "descent": 20}),
    "Clanet's disc, 3.5 m/s, 20/20, 400 rev/s": (
        "clanet_disc", {"speed": 3.5, "spin": 400, "attack": 20, "descent": 20}),
    "pebble of the lake, 11 m/s, 20/9, 20 rev/s": (
        "lake", {"speed": 11, "spin": 20, "attack": 20, "descent": 9}),
}  # fmt: skip


def scene_errors(name: str) -> dict[str, Any]:
    """The same for MuJoCo's integrators."""
    scene_name, settings = SCENES[name]
    scene = load_scene(scene_name)
    scene = scene.rethrow(**asdict(Throw.from_degrees(**settings, height=0.0)))
    scene = replace(scene, water=Water(air_density=0.0))
    unit = scene.stone.thickness / scene.throw.speed
    truth = exit_velocity(scene.stone, scene.throw, "adaptive", 0.05 * unit)

    def error(integrator: str, fraction: float) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                contact = simulate(
                    scene,
                    integrator=integrator,
                    timestep=fraction * unit,
                    limits=Limits(duration=0.12, min_airtime=LEFT),
                ).contacts[0]
            except DivergedError:
                return math.nan
        if contact.exit is None:
            return math.nan
        return float(np.linalg.norm(np.array(contact.exit.velocity) - truth)) / scene.throw.speed

    return {"throw": name} | {
        integrator: [error(integrator, f) for f in FRACTIONS]
        for integrator in ("Euler", "implicitfast", "RK4")
    }


def exit_ladder(_: Any = None) -> list[dict[str, Any]]:
    """Exit speed of the Clanet scene (100 rev/s) by every solver over the ladder of steps."""
    scene = reference_scene(spin=100.0)
    limits = Limits(duration=0.1, min_airtime=LEFT)

    def leaves_at(**options: Any) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                contact = simulate(scene, limits=limits, **options).contacts[0]
            except DivergedError:
                return math.nan
        return contact.exit.speed if contact.exit else math.nan

    truth = leaves_at(engine="reference", integrator="adaptive", timestep=2e-5)
    rows = []
    for engine, integrator in SOLVERS:
        errors = [
            abs(leaves_at(engine=engine, integrator=integrator, timestep=step) - truth)
            for step in LADDER
        ]
        rows.append(
            {
                "engine": engine,
                "integrator": integrator,
                "errors": errors,
                "order": observed_order(LADDER, [e if FLOOR < e < 0.1 else 0.0 for e in errors]),
            }
        )
    return rows


def compared(_: Any = None) -> dict[str, Any]:
    """`mjskip compare` on the Clanet scene at 100 rev/s."""
    scene = reference_scene(spin=100.0).rethrow(height=0.02)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = asdict(compare(scene))
    for row in found["rows"]:
        del row["step_seconds"]
    return found


def _job(name: str) -> Any:
    if name.startswith("mujoco:"):
        return scene_errors(name.removeprefix("mujoco:"))
    return {"ladder": exit_ladder, "compare": compared}.get(name, lambda: exit_errors(name))()


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """Errors, orders and the recommended fraction; short and full form are the same."""
    scenes = [f"mujoco:{name}" for name in SCENES]
    ladder, comparison, *others = in_parallel(_job, ["ladder", "compare", *scenes, *THROWS])
    scenes, throws = others[: len(SCENES)], others[len(SCENES) :]
    draw(ladder, throws, scenes, out / "convergence.png")
    return {
        "ladder": {"steps": LADDER, "rows": ladder},
        "compare": comparison,
        "fractions": FRACTIONS,
        "throws": throws,
        "mujoco_throws": scenes,
        "recommended": {
            method: recommended(throws, method) for method in ("euler", "midpoint", "rk4")
        }
        | {method: recommended(scenes, method) for method in ("Euler", "implicitfast", "RK4")},
    }


def recommended(throws: list[dict[str, Any]], method: str) -> float | None:
    """Largest fraction at and below which every throw's error is at most ENOUGH."""
    worst = np.max([throw[method] for throw in throws], axis=0)  # fractions fall along the list
    good = np.logical_and.accumulate((worst <= ENOUGH)[::-1])[::-1]
    return float(np.array(FRACTIONS)[good].max()) if good.any() else None


def draw(
    ladder: list[dict[str, Any]],
    throws: list[dict[str, Any]],
    scenes: list[dict[str, Any]],
    path: Path,
) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.4), layout="constrained")
    for row in ladder:
        key = row["engine"], row["integrator"]
        style = "o--" if key == ("reference", "rk4") else "o-"
        left.loglog(
            1e3 * np.array(LADDER),
            row["errors"],
            style,
            color=COLOURS[key],
            ms=5,
            label=" ".join(key),
        )
    left.set(
        xlabel="time step [ms]",
        ylabel="error of the exit speed [m/s]",
        title="Clanet's disc, 100 rev/s",
    )
    left.legend(fontsize=8.5)
    for runs, method, key in (
        (scenes, "Euler", ("mujoco", "Euler")),
        (scenes, "implicitfast", ("mujoco", "implicitfast")),
        (scenes, "RK4", ("mujoco", "RK4")),
        (throws, "euler", ("reference", "euler")),
        (throws, "midpoint", ("reference", "midpoint")),
        (throws, "rk4", ("reference", "rk4")),
    ):
        curves = np.array([run[method] for run in runs])
        style = "o--" if key == ("reference", "rk4") else "o-"
        right.loglog(FRACTIONS, curves.T, color=COLOURS[key], lw=0.6, alpha=0.3)
        right.loglog(FRACTIONS, curves.max(axis=0), style, color=COLOURS[key], ms=4)
    right.axhline(ENOUGH, color="#c0392b", ls="--", lw=1.2)
    right.set(
        xlabel="time step × speed / thickness",
        ylabel="error of the exit velocity / entry speed",
        title="many throws (thin), the worst (thick)",
        ylim=(1e-7, 3),
    )
    figure.savefig(path)
    plt.close(figure)


def page(found: dict[str, Any]) -> str:
    steps = found["ladder"]["steps"]
    orders = {(o["engine"], o["integrator"]): o for o in found["compare"]["orders"]}
    finest = {
        (r["engine"], r["integrator"]): r for r in found["compare"]["rows"] if r["timestep"] == 1e-4
    }
    rows = []
    for row in found["ladder"]["rows"]:
        key = row["engine"], row["integrator"]
        order, fine = orders[key], finest[key]
        rows.append(
            (
                *key,
                order["smooth_flight"],
                order["touch"],
                row["order"],
                f"{fine['touch_position']:.1e}" if fine["touch_position"] is not None else None,
                f"{fine['touch_attitude']:.1e}" if fine["touch_attitude"] is not None else None,
                f"{row['errors'][-1]:.1e}" if row["errors"][-1] is not None else None,
            )
        )
    by_step = [
        (
            f"{r['engine']} {r['integrator']}",
            *[None if e is None else f"{e:.1e}" for e in r["errors"]],
        )
        for r in found["ladder"]["rows"]
    ]
    limit = found["recommended"]
    agree = found["compare"]["agreement"][-1]
    named = ", ".join(f"{name} {value:g}" for name, value in limit.items() if value)
    stated = min(STEP_FRACTION, 1.0)
    at = found["fractions"].index(stated)
    worst = {
        name: max((run[name][at] if run[name][at] is not None else math.inf) for run in runs)
        for runs, names in (
            (found["mujoco_throws"], ("Euler", "implicitfast", "RK4")),
            (found["throws"], ("rk4",)),
        )
        for name in names
    }
    there = ", ".join(
        f"{name} {100 * value:.2g}%" if math.isfinite(value) else f"{name} diverges at 400 rev/s"
        for name, value in worst.items()
    )
    return (
        picture(
            "convergence.png",
            "Left: error of the exit speed by every solver. Right: error of the exit velocity against the "
            "step in units of thickness / speed; same colours; lines end where a run diverges.",
        )
        + f"\n\n**Recommended time step: {stated:g} × thickness / speed**, what `mjskip run` warns beyond "
        f"and `mjskip compare` prints. There the worst error of the exit velocity, as a share of the entry "
        f"speed, is: {there}. Largest fractions that keep every throw within {100 * ENOUGH:.0f}%: {named} "
        "(capitals: MuJoCo; small letters: pure integrator). The Eulers need less than the warning asks for, "
        "the faster the spin the less: use RK4 or implicitfast. "
        "In smooth flight every solver shows its order. Through a touch the force has kinks where triangles "
        "meet the surface, and no order above two is seen. Exit speeds are known to "
        f"{FLOOR:g} m/s, as the exit is sought between rows; orders are fitted above that. "
        "MuJoCo's RK4 and the pure one agree to "
        f"{agree['touch_position']:.0e} m and {agree['touch_attitude']:.0e} rad through the touch at "
        f"{1e3 * agree['timestep']:g} ms.\n\n"
        + table(
            (
                "engine",
                "integrator",
                "order, smooth flight",
                "order, position after a touch",
                "order, exit speed",
                "position at 0.1 ms [m]",
                "attitude [rad]",
                "exit speed [m/s]",
            ),
            rows,
        )
        + "\n\nError of the exit speed [m/s] by time step:\n\n"
        + table(("solver", *[f"{1e3 * s:g} ms" for s in steps]), by_step)
    )


if __name__ == "__main__":
    main(run, page)
