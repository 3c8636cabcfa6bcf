"""Do bodies as anybody writes them have the curves of a boundary-element code? `mjskip hydro` against Capytaine.

    python scripts/validation/floating_bodies.py [NAME ...] [--json FILE.json]        # all: some fifteen minutes

Every body is MJCF, goes through the command, and is compared with Capytaine's panels (two meshes, carried on to panels of
no size) over ka 0.2 to 2, a the radius of the disc with its waterplane: added mass at infinity; added mass and damping;
heave, surge and pitch in head waves. Errors are shares of Capytaine's value and of a fifth of its greatest.
Capytaine (GPL) is imported here only; it is no dependency of mjskip.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import capytaine as cpt
import numpy as np

import mjskip

RHO, G, COUNT = 1000.0, 9.81, 9
DOFS = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
TESTED = ("Surge", "Heave", "Pitch")
Quads = tuple[Any, Any]


def revolved(radius: Any, along: Any, count: int) -> Quads:
    """A profile (n) turned about z: points and quadrangles, normals outward for a profile that runs upward."""
    angle = 2.0 * np.pi * np.arange(count) / count
    points = np.stack(
        [
            np.outer(radius, np.cos(angle)),
            np.outer(radius, np.sin(angle)),
            np.repeat(np.asarray(along)[:, None], count, 1),
        ],
        axis=2,
    ).reshape(-1, 3)
    faces = [
        [i * count + j, i * count + (j + 1) % count, (i + 1) * count + (j + 1) % count, (i + 1) * count + j]
        for i in range(len(radius) - 1)
        for j in range(count)
    ]  # fmt: skip
    return points, np.array(faces)


def ellipsoid(a: float, b: float, c: float, n: int) -> Quads:
    """Half axes a, b, c."""
    polar = np.linspace(0.0, np.pi, 2 * n + 1)
    points, faces = revolved(np.sin(polar), -np.cos(polar), 4 * n)
    return points * [a, b, c], faces


def cylinder(radius: float, half: float, n: int) -> Quads:
    """Upright, panels finer towards the edge."""
    cap = radius * np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, n + 1))
    down = 2 * n * max(1, round(half / radius))
    wall = -half * np.cos(np.pi * np.linspace(0.0, 1.0, down + 1))
    return revolved(
        np.concatenate([cap, np.full(down - 1, radius), cap[::-1]]),
        np.concatenate([np.full(n + 1, -half), wall[1:-1], np.full(n + 1, half)]),
        4 * n,
    )


def capsule(radius: float, half: float, n: int) -> Quads:
    """Upright."""
    quarter = 0.5 * np.pi * np.linspace(0.0, 1.0, n + 1)
    down = n * max(1, round(1.2 * half / radius))
    wall = np.linspace(-half, half, down + 1)[1:-1]
    return revolved(
        np.concatenate([radius * np.sin(quarter), np.full(down - 1, radius), radius * np.cos(quarter)]),
        np.concatenate([-half - radius * np.cos(quarter), wall, half + radius * np.sin(quarter)]),
        4 * n,
    )  # fmt: skip


def lying(quads: Quads) -> Quads:
    """Turned from z to x."""
    return quads[0][:, [2, 0, 1]], quads[1]


def box(x: float, y: float, z: float, n: int) -> Quads:
    """Half lengths x, y, z; panels finer towards the edges."""
    least = min(x, y, z)
    counts = [n * round(2 * (half / least) ** 0.7) for half in (x, y, z)]
    points: list[Any] = []
    faces: list[Any] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        lines = [-np.cos(np.pi * np.linspace(0.0, 1.0, counts[k] + 1)) for k in (u, v)]
        for side in (-1.0, 1.0):
            grid = np.zeros((counts[u] + 1, counts[v] + 1, 3))
            grid[..., axis] = side
            grid[..., u], grid[..., v] = lines[0][:, None], lines[1]
            start = len(points)
            points += list(grid.reshape(-1, 3) * [x, y, z])
            for i in range(counts[u]):
                for j in range(counts[v]):
                    k = start + i * (counts[v] + 1) + j
                    ring = [k, k + counts[v] + 1, k + counts[v] + 2, k + 1]
                    faces.append(ring if side > 0 else ring[::-1])
    return np.array(points), np.array(faces)


def moved(quads: Quads, by: Any) -> Quads:
    """Somewhere else."""
    return quads[0] + np.asarray(by), quads[1]


def joined(*parts: Quads) -> Quads:
    """Several as one."""
    points, faces, count = [], [], 0
    for p, f in parts:
        points.append(p)
        faces.append(f + count)
        count += len(p)
    return np.concatenate(points), np.concatenate(faces)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A body: its geoms in MJCF, whose middle floats `height` over still water, and the same as quadrangles.

    `ballast` is how far its centre of mass lies below that middle.
    """

    geoms: str
    quads: Callable[[int], Quads]
    height: float
    width: float
    coarse: int
    depth: float = np.inf
    ballast: float = 0.0
    mass: float = 0.0


def geom(kind: str, size: str, density: float, more: str = "") -> str:
    """One geom."""
    return f'<geom type="{kind}" size="{size}" density="{density}" {more}/>'


LIE = 'euler="0 90 0"'
CASES = {
    "sphere of 1 m": Case(
        geoms=geom("sphere", "1", 500), quads=lambda n: ellipsoid(1, 1, 1, n), height=0.0, width=1.0,
        coarse=6,
    ),
    "sphere of 5 cm": Case(
        geoms=geom("sphere", ".05", 500), quads=lambda n: ellipsoid(0.05, 0.05, 0.05, n), height=0.0,
        width=0.05, coarse=6,
    ),
    "sphere, three quarters sunk": Case(
        geoms=geom("sphere", ".15", 843.75), quads=lambda n: ellipsoid(0.15, 0.15, 0.15, n), height=-0.075,
        width=0.13, coarse=6,
    ),
    "cylinder of draft 2 radii": Case(
        ballast=0.12, mass=float(np.pi * 0.04 * 0.4 * 1000),
        geoms=geom("cylinder", ".2 .3", 2000 / 3), quads=lambda n: cylinder(0.2, 0.3, n), height=-0.1,
        width=0.2, coarse=4,
    ),
    "cylinder of draft 0.3 radii": Case(
        geoms=geom("cylinder", ".5 .15", 500), quads=lambda n: cylinder(0.5, 0.15, n), height=0.0,
        width=0.5, coarse=6,
    ),
    "spar, draft 5 radii": Case(
        ballast=0.12, mass=float(np.pi * 0.01 * 0.5 * 1000),
        geoms=geom("cylinder", ".1 .3", 2500 / 3), quads=lambda n: cylinder(0.1, 0.3, n), height=-0.2,
        width=0.1, coarse=3,
    ),
    "cylinder lying": Case(
        geoms=geom("cylinder", ".15 .5", 500, LIE), quads=lambda n: lying(cylinder(0.15, 0.5, n)), height=0.0,
        width=0.31, coarse=4,
    ),
    "cube": Case(
        ballast=0.1,
        mass=62.5,
        geoms=geom("box", ".25 .25 .25", 500), quads=lambda n: box(0.25, 0.25, 0.25, n), height=0.0,
        width=0.28, coarse=4,
    ),
    "box 2 x 1 x 0.5": Case(
        geoms=geom("box", "1 .5 .25", 500), quads=lambda n: box(1, 0.5, 0.25, n), height=0.0,
        width=0.8, coarse=3,
    ),
    "box in water 0.5 m deep": Case(
        geoms=geom("box", ".5 .2 .1", 500), quads=lambda n: box(0.5, 0.2, 0.1, n), height=0.0,
        width=0.36, coarse=2, depth=0.5,
    ),
    "ellipsoid": Case(
        geoms=geom("ellipsoid", ".6 .25 .15", 500), quads=lambda n: ellipsoid(0.6, 0.25, 0.15, n), height=0.0,
        width=0.39, coarse=6,
    ),
    "capsule lying": Case(
        geoms=geom("capsule", ".15 .4", 500, LIE), quads=lambda n: lying(capsule(0.15, 0.4, n)), height=0.0,
        width=0.31, coarse=4,
    ),
    "catamaran": Case(
        geoms=geom("box", ".5 .1 .1", 500, 'pos="0 .3 0"') + geom("box", ".5 .1 .1", 500, 'pos="0 -.3 0"'),
        quads=lambda n: joined(
            moved(box(0.5, 0.1, 0.1, n), (0, 0.3, 0)), moved(box(0.5, 0.1, 0.1, n), (0, -0.3, 0))
        ),
        height=0.0, width=0.36, coarse=2,
    ),
}  # fmt: skip


def solved(case: Case, n: int, omega: Any) -> dict[str, Any]:
    """Capytaine's curves with one mesh."""
    points, faces = case.quads(n)
    mesh = cpt.Mesh(
        vertices=points + np.array([0.0, 0.0, case.height]), faces=faces
    ).immersed_part()
    centre = (0.0, 0.0, case.height - case.ballast)
    whole = cpt.FloatingBody(
        mesh=mesh, lid_mesh=mesh.generate_lid(), center_of_mass=centre, name="body",
        dofs=cpt.rigid_body_dofs(rotation_center=centre),
    )  # fmt: skip
    common = {"body": whole, "water_depth": case.depth, "rho": RHO, "g": G}
    problems: list[Any] = [
        cpt.RadiationProblem(radiating_dof=dof, omega=w, **common)
        for w in (*omega, np.inf)
        for dof in TESTED
    ] + [cpt.DiffractionProblem(wave_direction=0.0, omega=w, **common) for w in omega]
    data = cpt.assemble_dataset(cpt.BEMSolver().solve_all(problems, progress_bar=False))
    finite = data.sel(omega=omega)
    force = (finite.diffraction_force + finite.Froude_Krylov_force).squeeze("wave_direction")
    order = {"radiating_dof": list(TESTED), "influenced_dof": list(TESTED)}
    stiffness = whole.compute_hydrostatic_stiffness(rho=RHO, g=G)
    return {
        "size": mesh.nb_faces**-0.5,
        "added_mass": finite.added_mass.sel(order).transpose("omega", "influenced_dof", "radiating_dof").values,
        "radiation_damping": finite.radiation_damping.sel(order).transpose("omega", "influenced_dof", "radiating_dof").values,
        "infinite": data.added_mass.sel(omega=np.inf, **order).values,
        "force": force.sel(influenced_dof=list(TESTED)).values,
        "stiffness": stiffness.sel(order).values,
        "panels": mesh.nb_faces,
    }  # fmt: skip


def asked(case: Case, low: float, high: float) -> dict[str, Any]:
    """What the command says."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "body.xml"
        heavy = ""
        if case.ballast:
            heavy = f'<inertial pos="0 0 {-case.ballast}" mass="{case.mass}" diaginertia="2 2 1"/>'
        body = f'<body name="body"><freejoint/>{heavy}{case.geoms}</body>'
        file.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
        words = ["hydro", str(file), "--json", "--omega", f"{low}:{high}:{COUNT}"]
        if np.isfinite(case.depth):
            words += ["--depth", str(case.depth)]
        told = subprocess.run(
            [sys.executable, "-m", "mjskip", *words], check=True, capture_output=True, text=True
        )
        return dict(json.loads(told.stdout))


def error(ours: Any, theirs: Any) -> float:
    """Greatest error, as a share of the value and a fifth of the greatest: 5% is 5% and 1% of the greatest."""
    theirs = np.abs(theirs)
    return float((np.abs(np.abs(ours) - theirs) / (theirs + 0.2 * theirs.max())).max())


def compared(case: Case) -> dict[str, Any]:
    """One body."""
    low, high = (float(np.sqrt(G * ka / case.width)) for ka in (0.2, 2.0))
    omega = np.linspace(low, high, COUNT)
    ours = asked(case, low, high)
    coarse, fine = (solved(case, n * case.coarse, omega) for n in (1, 2))
    share = fine["size"] / (coarse["size"] - fine["size"])
    best = {k: fine[k] + share * (fine[k] - coarse[k]) for k in fine if k not in ("size", "panels")}
    k = [DOFS.index(dof) for dof in TESTED]
    pick = np.ix_(k, k)
    inertia = np.array(ours["inertia_matrix"], float)[pick]
    w = omega[:, None, None]
    impedance = (
        best["stiffness"]
        - w**2 * (inertia + best["added_mass"])
        - 1j * w * best["radiation_damping"]
    )
    known = np.abs(np.linalg.solve(impedance, best["force"][..., None])[..., 0])
    mine = np.array(ours["rao_amplitude"], float)[:, 0][:, k]
    found: dict[str, Any] = {"panels of Capytaine": [coarse["panels"], fine["panels"]]}
    for n, dof in enumerate(TESTED):
        if dof == "Pitch" and best["added_mass"][:, n, n].max() < 0.02 * inertia[n, n]:
            continue  # a sphere: nothing turns the water
        infinite = np.array(ours["infinite_added_mass"], float)[k[n], k[n]]
        row = {
            "infinite_added_mass": float(infinite / best["infinite"][n, n] - 1.0),
            "hydrostatic_stiffness": 0.0,
            "response": error(mine[:, n], known[:, n]),
        }
        if dof != "Surge":
            stiff = np.array(ours["hydrostatic_stiffness"], float)[k[n], k[n]]
            row["hydrostatic_stiffness"] = float(stiff / best["stiffness"][n, n] - 1.0)
        for name in ("added_mass", "radiation_damping"):
            row[name] = error(np.array(ours[name], float)[:, k[n], k[n]], best[name][:, n, n])
        found[dof] = {key: round(100.0 * value, 2) for key, value in row.items()}
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", default=[])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    cpt.set_logging("ERROR")
    found: dict[str, Any] = {
        "made by": f"mjskip {mjskip.__version__}, Capytaine {cpt.__version__}",
        "unit": "per cent of Capytaine's value",
    }
    for name in given.names or CASES:
        found[name] = compared(CASES[name])
        print(name, json.dumps(found[name]), flush=True)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
