"""What do the laws make of other bodies: spheres, plates, wedges, boats?

Ricochet of spheres, entry of spheres, slamming wedges, terminal speeds, planing plates, drafts: measured or
theoretical numbers, each with its source and how far it was seen, against every law; nothing is tuned. 20 s.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from _common import LAWS, in_parallel, main, table, threshold
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from mjskip import Limits, Stone, Throw, Water, integrate, wrench

TITLE = "Other bodies: spheres, plates, wedges, boats"

RHO, G = 1000.0, 9.81
RADIUS = 0.025
MEASURED = {"ricochet": 18.0, "entry": 1.0, "sphere": 0.44, "disc": 1.12}
DEPTHS = (0.05, 0.1, 0.2, 0.5)
PLANING = [(4.0, 1.0, 4.0), (4.0, 3.0, 4.0), (8.0, 1.0, 4.0), (8.0, 3.0, 4.0), (12.0, 2.0, 6.0)]
"""Trim [degrees], wetted length over beam, speed over sqrt(g beam)."""


def sphere(density: float, *, fineness: int = 3) -> Stone:
    """A tessellated sphere of the volume of the round one."""
    mesh = trimesh.creation.icosphere(subdivisions=fineness, radius=RADIUS)
    mesh.vertices *= (4.0 / 3.0 * math.pi * RADIUS**3 / mesh.volume) ** (1.0 / 3.0)
    return Stone.from_mesh(mesh, density=density)


def ricochet(law: str, ratio: float) -> float:
    """Largest descent at which a sphere leaves the water at 100 m/s, times the root of its density ratio [degrees]."""
    stone = sphere(ratio * RHO, fineness=2)

    def stays(descent: float) -> bool:
        contact = integrate(
            stone,
            Throw.from_degrees(speed=100.0, descent=descent, height=0.0),
            water=Water(law=law, air_density=0.0),
            timestep=2e-5,
            limits=Limits(
                duration=0.3, max_contact=0.25, min_airtime=2e-4, sink_depth=40.0 * RADIUS
            ),
        ).contacts[0]
        return contact.exit is None

    return math.sqrt(ratio) * threshold(stays, 1.0, 60.0, steps=9)


def entry(law: str) -> list[float]:
    """Force of a sphere that enters upright at 10 m/s, over 1/2 rho V^2 pi R^2, at DEPTHS of its radius."""
    stone, water = sphere(7800.0, fineness=4), Water(law=law, air_density=0.0)
    loads = [
        wrench(stone, water, position=(0, 0, RADIUS * (1.0 - d)), velocity=(0, 0, -10.0)).force[2]
        for d in DEPTHS
    ]
    return [f / (0.5 * RHO * 100.0 * math.pi * RADIUS**2) for f in loads]


def drag(law: str, stone: Stone, area: float) -> float:
    """Drag coefficient of a body that sinks flat, deep under water."""
    found = wrench(
        stone, Water(law=law, air_density=0.0), position=(0, 0, -1.0), velocity=(0, 0, -2.0)
    )
    return float(found.force[2] / (0.5 * RHO * 4.0 * area))


def wedge(law: str, deadrise: float) -> float:
    """Force on a long wedge at constant speed over von Karman's rho pi c V^2 / tan(deadrise)."""
    length, half, depth, speed = 10.0, 0.2, 0.05, 3.0
    rise = half * math.tan(deadrise)
    ends = [
        [x, y, z]
        for x in (-length / 2, length / 2)
        for y, z in ((0, 0), (half, rise), (-half, rise))
    ]
    stone = Stone.from_mesh(trimesh.convex.convex_hull(np.array(ends)), density=500.0)
    keel = stone.vertices[:, 2].min()
    found = wrench(
        stone,
        Water(law=law, air_density=0.0),
        position=(0, 0, -depth - keel),
        velocity=(0, 0, -speed),
    )
    wet = depth / math.tan(deadrise)
    return float(found.force[2] / length / (RHO * math.pi * wet * speed**2 / math.tan(deadrise)))


def planing(law: str, trim: float, length: float, cv: float) -> dict[str, float]:
    """Lift coefficient and place of the load (from the trailing edge, over the wetted length) of a planing plate."""
    beam, thin = 0.3, 1e-3
    speed, angle = cv * math.sqrt(G * beam), math.radians(trim)
    total = 6.0 * beam
    stone = Stone.from_mesh(trimesh.creation.box((total, beam, thin)), density=500.0)
    # the wet part of the lower face is `length` beams from the trailing edge
    turn = Rotation.from_euler("y", -angle)
    trailing = turn.apply([-total / 2, 0.0, -thin / 2])
    height = -length * beam * math.sin(angle) - trailing[2]
    at = {"position": (0.0, 0.0, height), "q": turn.as_quat(scalar_first=True)}
    water = Water(law=law, air_density=0.0, buoyancy=True)
    found = wrench(stone, water, **at, velocity=(speed, 0.0, 0.0))
    normal = turn.apply([0.0, 0.0, 1.0])
    ahead = -found.torque[1] / float(found.force @ normal)  # of the middle of the plate
    return {
        "lift": float(found.force[2] / (0.5 * RHO * speed**2 * beam**2)),
        "centre": (ahead + total / 2) / (length * beam),
    }


def savitsky(trim: float, length: float, cv: float) -> dict[str, float]:
    """His lift and centre of a flat plate, trim in degrees; 2 to 15, length <= 4, cv 0.6 to 13."""
    lift = trim**1.1 * (0.0120 * math.sqrt(length) + 0.0055 * length**2.5 / cv**2)
    return {"lift": lift, "centre": 0.75 - 1.0 / (5.21 * cv**2 / length**2 + 2.39)}


def law_row(law: str) -> dict[str, Any]:
    """Everything by one law."""
    disc, half = Stone.disc(0.05, 0.0005, segments=64, density=2700.0), math.pi * 0.05**2
    return {
        "law": law,
        "ricochet": {f"{ratio:g}": ricochet(law, ratio) for ratio in (2.7, 7.8)},
        "entry": entry(law),
        "sphere": drag(law, sphere(2700.0), math.pi * RADIUS**2),
        "disc": drag(law, disc, half),
        "wedge": {f"{b:g}": wedge(law, math.radians(b)) for b in (10.0, 30.0, 45.0)},
        "planing": [planing(law, *case) for case in PLANING],
    }


def drafts() -> list[dict[str, Any]]:
    """Drafts of bodies at rest by the wrench and in closed form [m]."""
    water = Water(buoyancy=True, air_density=0.0)
    rows = []
    for ratio in (0.25, 0.5, 0.8):
        ball = sphere(ratio * RHO, fineness=4)
        box = Stone.from_mesh(trimesh.creation.box((0.4, 0.3, 0.1)), density=ratio * RHO)
        exact = brentq(lambda d, r=ratio: d * d * (3.0 - d) / 4.0 - r, 0.0, 2.0) * RADIUS
        for name, stone, expected in (("sphere", ball, exact), ("box", box, ratio * 0.1)):
            low = -stone.vertices[:, 2].min()

            def sinks(draft: float, stone: Any = stone, low: float = low) -> float:
                lift = wrench(stone, water, position=(0, 0, low - draft)).force[2]
                return float(lift - stone.mass * G)

            draft = brentq(sinks, 1e-6, 2.0 * low - 1e-6, xtol=1e-12)
            rows.append({"body": name, "ratio": ratio, "draft": draft, "expected": expected})
    return rows


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """All rows; short and full form are the same."""
    return {
        "laws": {row["law"]: row for row in in_parallel(law_row, LAWS)},
        "savitsky": [savitsky(*case) for case in PLANING],
        "drafts": drafts(),
    }


def page(found: dict[str, Any]) -> str:
    laws = found["laws"]

    def each(make: Any) -> list[Any]:
        return [make(laws[law]) for law in LAWS]

    def bias(value: float | None, measured: float, form: str = ".3g") -> str:
        return "–" if value is None else f"{value:{form}} ({100 * (value / measured - 1):+.0f}%)"

    rows = [
        *(
            (
                f"ricochet of a sphere, 100 m/s: critical angle × √{ratio} [°]", "18",
                *each(lambda r, k=ratio: bias(r["ricochet"][k], 18.0)),
            )
            for ratio in ("2.7", "7.8")
        ),
        *(
            (f"entry of a sphere: force / ½ρV²πR² at depth {d:g} R", "about 1 at 0.1 to 0.2 R" if d <= 0.2 else "–",
             *each(lambda r, k=k: r["entry"][k]))
            for k, d in enumerate(DEPTHS)
        ),
        ("drag of a sunk sphere, C_D", "0.40–0.47", *each(lambda r: bias(r["sphere"], MEASURED["sphere"]))),
        ("… so its terminal speed", "–",
         *each(lambda r: f"{100 * (math.sqrt(MEASURED['sphere'] / r['sphere']) - 1):+.0f}%")),
        ("drag of a disc broadside, C_D", "1.12–1.17", *each(lambda r: bias(r["disc"], MEASURED["disc"]))),
        ("… so its terminal speed", "–",
         *each(lambda r: f"{100 * (math.sqrt(MEASURED['disc'] / r['disc']) - 1):+.0f}%")),
        *(
            (f"wedge, deadrise {b}°: force over von Karman's", f"1; Wagner {math.pi**2 / 4:.2f}",
             *each(lambda r, k=b: r["wedge"][k]))
            for b in ("10", "30", "45")
        ),
        *(
            (f"planing plate, trim {t:g}°, λ {n:g}, C_v {cv:g}: lift", f"{s['lift']:.3f}",
             *each(lambda r, k=k, s=s: bias(r["planing"][k]["lift"], s["lift"])))
            for k, ((t, n, cv), s) in enumerate(zip(PLANING, found["savitsky"], strict=True))
        ),
        *(
            (f"… trim {t:g}°, λ {n:g}, C_v {cv:g}: centre / wetted length", f"{s['centre']:.3f}",
             *each(lambda r, k=k: f"{r['planing'][k]['centre']:.3f}"))
            for k, ((t, n, cv), s) in enumerate(zip(PLANING, found["savitsky"], strict=True))
        ),
    ]  # fmt: skip
    worst = max(abs(d["draft"] / d["expected"] - 1.0) for d in found["drafts"])
    birkhoff = laws["birkhoff1944"]
    return (
        table(("quantity", "measured", *LAWS), rows)
        + "\n\n**For spheres take `birkhoff1944`**, ½ρ(V·n)²: "
        f"{birkhoff['ricochet']['2.7']:.1f}° and {birkhoff['ricochet']['7.8']:.1f}° where 18° is measured, and "
        f"C_D {birkhoff['sphere']:.2f}. No constant factor fits both spheres and slow thin discs.\n\n"
        "Sources, and how far they were seen. *Ricochet*: de Jonquières 1883, θ_c = 18°/√σ, read in the "
        "introduction of Hurd et al., Sci. Rep. 9:6042 (2019), and in Nagahiro & Hayakawa, Phys. Rev. Lett. 94:174501 "
        "(2005); the uncertainty is not given there, a degree is a guess. That Birkhoff et al. (1944) and Johnson & "
        "Reid (J. Mech. Eng. Sci. 17:71, 1975) press with ½ρ(V·n)² is second hand: neither was seen. Hurd et al. say "
        "that Birkhoff's model is not completely analytical and rests on assumptions that are not all true. *Entry of "
        "a sphere*: peak of about 1, from memory of Moghisi & Squire (J. Fluid Mech. 108:133, 1981) and May (1975), "
        "±20%, not seen. It is the added mass that grows with the wetted cap: no law of (V·n) has it, and a "
        "light body's first millisecond is too soft. *Drag*: textbook values at Re 1e4 to 2e5 (sphere) and above 1e3 "
        "(disc), as in Hoerner's collection, second hand, ±5%. *Wedge*: von Karman (NACA TN 321, 1929), force "
        "ρπcV²/tan β with c the wet half width, and Wagner (1932), π²/4 of that for the water that rises: "
        "theory, exact for small deadrise. Every law falls short by a factor of three and more: the "
        "water that a slamming hull sets in motion is in none of them. *Planing*: "
        "Savitsky, Marine Technology 1:71 (1964), C_L = τ^1.1 (0.0120 λ^0.5 + 0.0055 λ^2.5/C_v²), centre 0.75 − 1/(5.21 "
        "C_v²/λ² + 2.39) of the wetted length, within 2 to 15°, λ ≤ 4, C_v 0.6 to 13: read in programs that "
        "compute it, not in the paper; his data scatter by some 10%. A flow in a plane has no sides to escape by: "
        "the lift of long plates is too large by the laws that are linear in the normal speed, that of the square too "
        "small. *Drafts* of a floating sphere and box at density ratios 0.25, 0.5 and 0.8: Archimedes, off by "
        f"{worst:.0e} at most (the sphere is a mesh)."
    )


if __name__ == "__main__":
    main(run, page)
