"""What is wet in a model and what it costs, in words and as data."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from mjskip.coupling.bodies import body_name, free_bodies, geom_name, kind_name, posed
from mjskip.coupling.flotation import flotation_of
from mjskip.errors import MjskipError
from mjskip.hydro.hydrostatics import SinksError
from mjskip.hydro.wrench import wrench_address

if TYPE_CHECKING:
    from mjskip.coupling.attach import Coupling


@dataclass(frozen=True, kw_only=True)
class BodyReport:
    """One moving body.

    Attributes:
        name: of the body, or its number.
        welded: names of the bodies that are welded to it.
        wet: whether water acts on it.
        geoms: its wet geoms, with their kind.
        left_out: why others are not, by geom.
        why_dry: of a dry body.
        faces: of its hull.
        faces_before: before a face budget; the same where there was none to keep.
        volume: within the hull [m^3].
        area: of the hull [m^2].
        volume_error: relative, of the face budget before the volume was put right.
        area_error: relative, of the face budget.
        mass: of it and what is welded to it [kg].
    """

    name: str
    welded: tuple[str, ...] = ()
    wet: bool = True
    geoms: tuple[str, ...] = ()
    left_out: dict[str, str]
    why_dry: str = ""
    faces: int = 0
    faces_before: int = 0
    volume: float = 0.0
    area: float = 0.0
    volume_error: float = 0.0
    area_error: float = 0.0
    mass: float = 0.0


@dataclass(frozen=True, kw_only=True)
class TreeReport:
    """A tree of bodies with a free root, its joints as they are.

    Attributes:
        name: of the root.
        mass: of the whole tree [kg].
        volume: of its hulls together, overlaps counted twice [m^3].
        union: of what they fill [m^3].
        draft, trim, heel: as it floats at rest [m, rad]; None if it sinks.
        metacentric_height: GM there for heel [m]; None if it sinks.
        flotation: "floats", "sinks", or why nothing was found.
    """

    name: str
    mass: float
    volume: float
    union: float
    draft: float | None = None
    trim: float | None = None
    heel: float | None = None
    metacentric_height: float | None = None
    flotation: str = ""


@dataclass(frozen=True, kw_only=True)
class Report:
    """What is wet in a model.

    Attributes:
        bodies: every moving body.
        trees: every free tree that is wet.
        overlaps: volumes that two bodies across a joint share, by their names [m^3]: they count twice.
        faces: of all hulls.
        wet_microseconds: all bodies half immersed, one evaluation of the forces, here and now.
        bare_microseconds: one step of the model without water, here and now.
        evaluations: of the forces in a step: 4 with RK4.
        warnings: what should be looked at.
    """

    bodies: tuple[BodyReport, ...]
    trees: tuple[TreeReport, ...]
    overlaps: dict[str, float]
    faces: int
    wet_microseconds: float
    bare_microseconds: float
    evaluations: int
    warnings: tuple[str, ...]

    @property
    def step_ratio(self) -> float:
        """Estimate of a step in water over a bare one."""
        return 1.0 + self.evaluations * self.wet_microseconds / self.bare_microseconds

    def to_dict(self) -> dict[str, Any]:
        """As plain data, SI units, for JSON."""
        return asdict(self) | {"step_ratio": self.step_ratio}

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        for body in self.bodies:
            welded = f" with {', '.join(body.welded)}" if body.welded else ""
            if not body.wet:
                yield f"{body.name}{welded}: dry, {body.why_dry}"
                continue
            yield (
                f"{body.name}{welded}: {body.faces} faces{_budget(body)}, {1e3 * body.volume:.4g} l, "
                f"{body.mass:.4g} kg"
            )
            yield f"  wet: {', '.join(body.geoms)}"
            for geom, why in body.left_out.items():
                yield f"  left out: {geom} {why}"
        for tree in self.trees:
            yield (
                f"tree of {tree.name}: {tree.mass:.4g} kg, {1e3 * tree.volume:.4g} l "
                f"({1e3 * tree.union:.4g} l without overlaps): {_afloat(tree)}"
            )
        for pair, volume in self.overlaps.items():
            yield f"overlap of {pair}: {1e3 * volume:.3g} l count twice"
        yield (
            f"cost: {self.faces} faces; half immersed {self.wet_microseconds:.3g} us an evaluation beside "
            f"{self.bare_microseconds:.3g} us a bare step, so about {self.step_ratio:.2g} times a bare step"
        )
        for warning in self.warnings:
            yield f"warning: {warning}"


def _budget(body: BodyReport) -> str:
    if body.faces_before == body.faces:
        return ""
    return (
        f" of {body.faces_before} (volume {100 * body.volume_error:+.2g}% before it was put right, area "
        f"{100 * body.area_error:+.2g}%)"
    )


def _afloat(tree: TreeReport) -> str:
    if tree.draft is None or tree.trim is None or tree.heel is None:
        return tree.flotation
    trim, heel = np.degrees([tree.trim, tree.heel])
    return (
        f"floats at draft {tree.draft:.4g} m, trim {trim + 0.0:.2f} deg, heel {heel:.2f} deg, "
        f"GM {tree.metacentric_height:.3g} m"
    )


def report_of(coupling: Coupling, data: mujoco.MjData | None = None) -> Report:
    """What is wet in a model, in the pose of `data` or `qpos0`."""
    model = coupling.model
    own = posed(model, data)
    solids = _placed(coupling, own)
    wet, bare = _costs(coupling)
    bodies = [_wet_body(coupling, k) for k in range(len(coupling.bodies))]
    bodies += [
        BodyReport(name=body_name(model, b), wet=False, why_dry=why, left_out={})
        for b, why in coupling.dry.items()
    ]
    return Report(
        bodies=tuple(bodies),
        trees=tuple(_trees(coupling, own, solids)),
        overlaps=_overlaps(coupling, solids),
        faces=sum(len(hull.faces) for hull in coupling.hulls),
        wet_microseconds=wet,
        bare_microseconds=bare,
        evaluations=4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else 1,
        warnings=(*coupling.warnings, *(t for b in coupling.built for t in b.warnings)),
    )


def _wet_body(coupling: Coupling, k: int) -> BodyReport:
    model, wet, built = coupling.model, coupling.wet[k], coupling.built[k]
    hull, simple = coupling.hulls[k], built.simplification
    lost = {wet.geoms[place]: why for place, why in built.lost.items()}
    return BodyReport(
        name=body_name(model, wet.body),
        welded=tuple(body_name(model, m) for m in wet.members[1:]),
        geoms=tuple(
            f"{geom_name(model, g)} ({kind_name(model, g)})" for g in wet.geoms if g not in lost
        ),
        left_out={geom_name(model, g): why for g, why in {**wet.left_out, **lost}.items()},
        faces=len(hull.faces),
        faces_before=simple.faces_before if simple else len(hull.faces),
        volume=hull.volume,
        area=hull.area,
        volume_error=simple.volume_error if simple else 0.0,
        area_error=simple.area_error if simple else 0.0,
        mass=coupling.inertias[k].mass,
    )


def _placed(coupling: Coupling, data: mujoco.MjData) -> list[Any]:
    """The hulls as meshes in the world."""
    import trimesh

    return [
        trimesh.Trimesh(
            hull.vertices @ data.xmat[body].reshape(3, 3).T + coupling.centre(data, k),
            hull.faces,
            process=False,
        )
        for k, (body, hull) in enumerate(zip(coupling.bodies, coupling.hulls, strict=True))
    ]


def _trees(coupling: Coupling, data: mujoco.MjData, solids: list[Any]) -> Iterator[TreeReport]:
    from mjskip.hydro.solids import union

    model = coupling.model
    for root in free_bodies(model):
        rows = [k for k, b in enumerate(coupling.bodies) if int(model.body_rootid[b]) == root]
        if not rows:
            continue
        volume = sum(coupling.hulls[k].volume for k in rows)
        try:
            filled = float(union([solids[k] for k in rows]).volume)
        except MjskipError:
            filled = volume
        known: dict[str, Any] = {
            "name": body_name(model, root),
            "mass": float(model.body_subtreemass[root]),
            "volume": volume,
            "union": filled,
        }
        try:
            found = flotation_of(coupling, data, root)
        except SinksError:
            yield TreeReport(**known, flotation="sinks")
        except MjskipError as error:
            yield TreeReport(**known, flotation=str(error))
        else:
            yield TreeReport(
                **known,
                draft=found.draft,
                trim=found.trim,
                heel=found.heel,
                metacentric_height=found.hydrostatics.metacentric_height,
                flotation="floats",
            )


def _overlaps(coupling: Coupling, solids: list[Any]) -> dict[str, float]:
    from mjskip.hydro.solids import intersection_volume

    model, found = coupling.model, {}
    for a, b in combinations(range(len(solids)), 2):
        if model.body_rootid[coupling.bodies[a]] != model.body_rootid[coupling.bodies[b]]:
            continue
        try:
            shared = intersection_volume(solids[a], solids[b])
        except MjskipError:
            continue
        if shared > 1e-6 * min(solids[a].volume, solids[b].volume):
            names = (body_name(model, coupling.bodies[k]) for k in (a, b))
            found[" and ".join(names)] = shared
    return found


def _costs(coupling: Coupling) -> tuple[float, float]:
    """Microseconds of one evaluation with every body half immersed, and of a bare step."""
    import ctypes

    call = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)(wrench_address())
    out, wet = np.empty(12), 0.0
    state = np.zeros(18)
    state[[3, 7, 11]] = 1.0
    state[12:] = 0.1
    for block in coupling.blocks:
        arguments = block.ctypes.data, state.ctypes.data, out.ctypes.data
        wet += _shortest(lambda: call(*arguments), 20)  # noqa: B023
    model = coupling.model
    data = mujoco.MjData(model)
    slot_empty = not coupling.is_open
    mujoco.mj_step(model, data)
    bare = _shortest(lambda: mujoco.mj_step(model, data), 20)
    return wet, bare if slot_empty else max(bare - wet, 1e-3)


def _shortest(act: Any, count: int) -> float:
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        act()
        times.append(time.perf_counter() - begun)
    return 1e6 * float(np.median(times))
