"""Capytaine's numbers for floating bodies: what the tests compare with where Capytaine is not installed.

    python scripts/validation/floating_oracle.py        # writes tests/capytaine.json, some minutes

Capytaine (pip install capytaine; GPL) is a boundary-element code; it is no dependency of mjskip and is imported here only.
Hulls are those of `tests/hulls.py`, with Capytaine's own meshes where it has them, lids against irregular frequencies.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import capytaine as cpt
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
import hulls

OUT = Path(__file__).parents[2] / "tests" / "capytaine.json"
RHO, G = 1000.0, 9.81
DOFS = ("Surge", "Heave", "Pitch")


def solved(bodies: list[Any], omega: list[float], dofs: list[str], *, depth: float = np.inf) -> Any:
    """Radiation at all frequencies and at infinity, diffraction in head waves."""
    whole = cpt.Multibody(bodies) if len(bodies) > 1 else bodies[0]
    problems: list[Any] = []
    for w in omega:
        for dof in dofs:
            problems.append(
                cpt.RadiationProblem(
                    body=whole, radiating_dof=dof, omega=w, water_depth=depth, rho=RHO, g=G
                )
            )
        problems.append(
            cpt.DiffractionProblem(
                body=whole, wave_direction=0.0, omega=w, water_depth=depth, rho=RHO, g=G
            )
        )
    problems += [
        cpt.RadiationProblem(
            body=whole, radiating_dof=dof, omega=np.inf, water_depth=depth, rho=RHO, g=G
        )
        for dof in dofs
    ]
    results = cpt.BEMSolver().solve_all(problems, progress_bar=False)
    return cpt.assemble_dataset(results)


def floating(mesh: Any, centre: tuple[float, float, float], name: str) -> Any:
    """A rigid body with a lid, below the water."""
    immersed = mesh.immersed_part()
    return cpt.FloatingBody(
        mesh=immersed,
        lid_mesh=immersed.generate_lid(),
        dofs=cpt.rigid_body_dofs(rotation_center=centre),
        center_of_mass=centre,
        name=name,
    )


def table(data: Any, dofs: list[str]) -> dict[str, Any]:
    """Numbers by dof, and the excitation by real and imaginary part."""
    finite = data.sel(omega=data.omega[np.isfinite(data.omega)])
    pick = {"radiating_dof": dofs, "influenced_dof": dofs}
    force = finite.diffraction_force.sel(influenced_dof=dofs) + finite.Froude_Krylov_force.sel(
        influenced_dof=dofs
    )
    force = force.squeeze("wave_direction")
    return {
        "omega": finite.omega.values.tolist(),
        "dofs": dofs,
        "added_mass": finite.added_mass.sel(pick)
        .transpose("omega", "influenced_dof", "radiating_dof")
        .values.tolist(),
        "radiation_damping": finite.radiation_damping.sel(pick)
        .transpose("omega", "influenced_dof", "radiating_dof")
        .values.tolist(),
        "infinite_added_mass": data.added_mass.sel(omega=np.inf, **pick)
        .transpose("influenced_dof", "radiating_dof")
        .values.tolist(),
        "excitation": [force.real.values.tolist(), force.imag.values.tolist()],
    }


def converged(meshes: list[Any], height: float, dofs: list[str]) -> list[float]:
    """Added mass at infinity of two meshes, carried on to panels of no size: its error falls with their size."""
    rows = []
    for mesh in meshes:
        body = cpt.FloatingBody(
            mesh=mesh.immersed_part(),
            dofs=cpt.rigid_body_dofs(rotation_center=(0, 0, height)),
            name="body",
        )
        problems = [
            cpt.RadiationProblem(body=body, radiating_dof=d, omega=np.inf, rho=RHO, g=G)
            for d in dofs
        ]
        results = cpt.BEMSolver().solve_all(problems, progress_bar=False)
        by_dof = {r.radiating_dof: r.added_masses[r.radiating_dof] for r in results}
        rows.append([body.mesh.nb_faces**-0.5, *(float(by_dof[d]) for d in dofs)])
    coarse, fine = np.array(rows)
    slope = (coarse[1:] - fine[1:]) / (coarse[0] - fine[0])
    return [float(x) for x in fine[1:] - slope * fine[0]]


def infinite() -> dict[str, Any]:
    """Added mass at infinity, converged, by body and dof."""
    a = hulls.RADIUS
    balls = [
        cpt.mesh_sphere(radius=a, center=(0, 0, 0), resolution=(2 * n, 2 * n)) for n in (12, 24)
    ]
    boxes = [
        cpt.mesh_parallelepiped(
            size=(1.0, 0.4, 0.2),
            center=(0, 0, 0),
            resolution=(12 * n, 5 * n, 4 * n),
            missing_sides={"top"},
        )
        for n in (2, 4)
    ]
    ships = [
        cpt.Mesh(vertices=points, faces=faces)
        for points, faces in (hulls.ship_panels(40, 8), hulls.ship_panels(64, 14))
    ]
    plates = [
        cpt.mesh_vertical_cylinder(
            radius=a, length=0.04, center=(0, 0, 0), resolution=(n, 4 * n, n // 4)
        )
        for n in (8, 16)
    ]
    parts = {
        "sphere": (balls, 0.0, ["Surge", "Heave"]),
        "disc": (plates, 0.0, ["Heave"]),
        "barge": (boxes, hulls.BARGE_CENTRE, list(DOFS)),
        "ship": (ships, hulls.SHIP_CENTRE, list(DOFS)),
    }
    return {
        name: dict(zip(dofs, converged(meshes, height, dofs), strict=True))
        for name, (meshes, height, dofs) in parts.items()
    }


def main() -> None:
    cpt.set_logging("ERROR")
    found: dict[str, Any] = json.loads(OUT.read_text()) if OUT.is_file() else {}
    found |= {"made by": f"Capytaine {cpt.__version__}", "converged": infinite()}
    if "--infinite" in sys.argv:
        OUT.write_text(json.dumps(found) + "\n")
        return
    a = hulls.RADIUS
    omega = [float(np.sqrt(G * ka / a)) for ka in hulls.KA]
    sphere = cpt.mesh_sphere(radius=a, center=(0, 0, 0), resolution=(48, 48), name="sphere")
    found["sphere"] = table(
        solved([floating(sphere, (0, 0, 0), "sphere")], omega, ["Surge", "Heave"]),
        ["Surge", "Heave"],
    )
    found["sphere in water 0.3 m deep"] = table(
        solved([floating(sphere, (0, 0, 0), "sphere")], omega, ["Surge", "Heave"], depth=0.3),
        ["Surge", "Heave"],
    )
    pair = [
        floating(
            cpt.mesh_sphere(
                radius=a, center=(side * hulls.APART / 2, 0, 0), resolution=(32, 36), name=name
            ),
            (side * hulls.APART / 2, 0, 0),
            name,
        )
        for side, name in ((-1, "first"), (1, "second"))
    ]
    dofs = [f"{name}__{dof}" for name in ("first", "second") for dof in ("Surge", "Heave")]
    found["two spheres"] = table(solved(pair, omega, dofs), dofs)
    disc = cpt.mesh_vertical_cylinder(
        radius=a, length=0.04, center=(0, 0, 0), resolution=(20, 64, 6), name="disc"
    )
    found["disc"] = table(solved([floating(disc, (0, 0, 0), "disc")], omega, ["Heave"]), ["Heave"])
    barge = cpt.mesh_parallelepiped(
        size=(1.0, 0.4, 0.2),
        center=(0, 0, 0),
        resolution=(36, 15, 12),
        missing_sides={"top"},
        name="barge",
    )
    found["barge"] = table(
        solved(
            [floating(barge, (0, 0, hulls.BARGE_CENTRE), "barge")], hulls.BARGE_OMEGA, list(DOFS)
        ),
        list(DOFS),
    )
    points, faces = hulls.ship_panels()
    ship = cpt.Mesh(vertices=points, faces=faces, name="ship")
    found["ship"] = table(
        solved([floating(ship, (0, 0, hulls.SHIP_CENTRE), "ship")], hulls.SHIP_OMEGA, list(DOFS)),
        list(DOFS),
    )
    OUT.write_text(json.dumps(found) + "\n")
    for name, part in found.items():
        if isinstance(part, dict):
            print(name, part["dofs"], np.array(part["infinite_added_mass"]).diagonal())


if __name__ == "__main__":
    main()
