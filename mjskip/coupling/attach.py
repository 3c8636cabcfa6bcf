"""Water on the bodies of any MuJoCo model: `attach`."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array
from mjskip.checks import check_array, check_count, check_type, fault
from mjskip.coupling import callback
from mjskip.coupling.bodies import body_id, body_name, find_body
from mjskip.coupling.plugin_keys import plugin_water
from mjskip.coupling.records import (
    gravity_warnings,
    make_record,
    physical_warnings,
    too_large_step,
)
from mjskip.coupling.sea import (
    FloatingHull,
    SeaSurface,
    attach_surface,
    detach_surface,
    finer,
    register_surface,
)
from mjskip.coupling.selection import BodyRule, GeomRule, WetBody, select
from mjskip.coupling.wet import BuiltHull, HullOptions, Inertia, Interior, hull_of, inertia_of
from mjskip.errors import CouplingError, DivergedError, MjskipWarning, SceneError
from mjskip.hydro import primitives
from mjskip.hydro.hull import Hull
from mjskip.hydro.hydrostatics import Hydrostatics, hydrostatics
from mjskip.hydro.seas import Sea
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import Wrench, pack, wrench_of
from mjskip.rigid.state import pack_states

ACTUATION = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
SILENCED = (
    'the water stopped acting: <flag actuation="disable"/> was set while it was attached, which silences callbacks; '
    "enable actuation, or close() first"
)


class Coupling:
    """Water that acts on bodies of one model, from `attach` until `close`.

    It may be used with `with`, kept, closed, and entered again. The water acts as long as the model lives,
    also if this object is dropped; attaching the model again then takes its place.

    Attributes:
        model: the model; a copy of it counts as another model.
        bodies: ids of the bodies the water acts on.
        hulls: what each of them is to the water, in the same order.
        water: the fluid.
        blocks: what the force kernel knows of each; a patch of surface may be put there.
        wet: the geoms of each, and why others are left out.
        dry: why the other moving bodies are dry, by id.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData | None,
        water: Water,
        *,
        bodies: BodyRule = None,
        geoms: GeomRule = None,
        options: HullOptions | None = None,
        native: bool = True,
        sea: Sea | None = None,
    ) -> None:
        """Choose what is wet and prepare it; `open` lets the water act.

        Args:
            model: compiled.
            data: in which loads are set back when the water stops acting; may be None.
            water: the fluid.
            bodies, geoms: what is wet, see `mjskip.attach`.
            options: how hulls are made.
            native: False for a callback in Python.
            sea: waves and current about bodies that radiate.

        Raises:
            ValueError: an argument is not allowed.
            SceneError: the model lacks what is asked for.
        """
        _check_arguments(model, data, water)
        _check_sea(model, water, sea, native)
        self.model, self.water = model, water
        options = options or HullOptions()
        if water.radiation:
            options = finer(options)
        self._data, self._native = data, native
        chosen = select(model, bodies, geoms)
        self.dry: dict[int, str] = dict(chosen.dry)
        self.wet: list[WetBody] = []
        self.built: list[BuiltHull] = []
        self.inertias: list[Inertia] = []
        for wet in chosen.wet:
            inertia = inertia_of(model, wet.body, wet.members)
            built = hull_of(model, wet, options, inertia)
            if built.hull is None:
                self.dry[wet.body] = "none of its geoms is a solid"
                continue
            self.wet.append(wet)
            self.built.append(built)
            self.inertias.append(inertia)
        if not self.wet:
            reasons = "; ".join(f"{body_name(model, b)!r}: {why}" for b, why in self.dry.items())
            raise SceneError(f"this model has no geom for water to act on: {reasons}")
        self.bodies: tuple[int, ...] = tuple(wet.body for wet in self.wet)
        self.hulls: tuple[Hull, ...] = tuple(b.hull for b in self.built if b.hull is not None)
        gravity = float(-model.opt.gravity[2])
        self.blocks: list[Array] = [pack(hull, water, gravity=gravity) for hull in self.hulls]
        self.records: list[Array] = [
            make_record(hull, water, inertia, block)
            for hull, inertia, block in zip(self.hulls, self.inertias, self.blocks, strict=True)
        ]
        self.surface = self._prepare_surface(sea) if water.radiation else None
        self._entry = callback.Entry(
            model, self.bodies, self.records, self.blocks, self.inertias, self.surface
        )
        self._before: Array | None = None
        self._shapes_before = self._shapes()
        self._depth = 0
        self._remove: Callable[[], bool] | None = None
        self._told: set[str] = set()
        self.warnings = physical_warnings(
            model, water, zip(self.bodies, (w.members for w in self.wet), self.built, strict=True)
        )

    def _prepare_surface(self, sea: Sea | None) -> SeaSurface:
        """The surface of the bodies that radiate: roots of trees."""
        model, own = self.model, mujoco.MjData(self.model)
        if self._data is not None:
            own.qpos[:] = self._data.qpos
        mujoco.mj_kinematics(model, own)
        floating = [
            FloatingHull(
                body=body,
                name=body_name(model, body),
                hull=self.hulls[k],
                inertia=self.inertias[k],
                carried=float(model.body_subtreemass[body]),
                rotation=own.xmat[body].reshape(3, 3).copy(),
                place=self.centre(own, k),
            )
            for k, body in enumerate(self.bodies)
            if int(model.body_rootid[body]) == body
        ]
        if not floating:
            raise SceneError(
                "radiation is on and no wet body is the root of a tree: nothing makes waves"
            )
        calm = Sea(gravity=float(-model.opt.gravity[2]))
        return attach_surface(floating, self.water, sea or calm, timestep=float(model.opt.timestep))

    def elevation(self, data: mujoco.MjData, points: npt.ArrayLike) -> Array:
        """Height of the surface (n,) [m]: the sea and the waves that bodies make; 0 if they make none.

        Args:
            data: of the attached model.
            points: horizontal places (n, 2) [m].
        """
        self._check_data(data)
        if self.surface is None:
            return np.zeros(len(np.atleast_2d(check_array("points", points))))
        return self.surface.elevation(self.surface.state_of(data), points)

    def grid_elevation(self, data: mujoco.MjData, x: Array, y: Array) -> Array:
        """The same at the points of a grid, quickly: (nx, ny) [m].

        Args:
            data: of the attached model.
            x, y: axes of the grid (nx,) and (ny,) [m].
        """
        self._check_data(data)
        if self.surface is None:
            return np.zeros((len(x), len(y)))
        return self.surface.grid_elevation(self.surface.state_of(data), x, y)

    def __repr__(self) -> str:
        names = [body_name(self.model, body) for body in self.bodies]
        shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        state = "acting" if self.is_open else "closed"
        return f"<Coupling: water on {shown}, {state}>"

    @property
    def is_open(self) -> bool:
        """Whether the water acts."""
        return self._remove is not None

    def open(self) -> Coupling:
        """Let the water act (again).

        Raises:
            SceneError: the model is attached already, or it silences callbacks.
        """
        if self._remove is not None:
            return self
        if self.model.opt.disableflags & ACTUATION:
            raise SceneError(
                'this model says <flag actuation="disable"/>, which silences callbacks: remove it so that '
                "water can act"
            )
        for wet in self.wet:
            _refuse_plugged(self.model, wet.members)
        self._entry.forget()
        self._told.clear()
        if self.surface is not None:
            register_surface(self.surface)
        install = callback.install_native if self._native else callback.install_python
        self._remove = install(self, self._entry)
        if self._data is not None:
            self._before = self._data.xfrc_applied[list(self.bodies)].copy()
        return self

    def close(self) -> None:
        """End the water and put `xfrc_applied` back, then `check`. Again does nothing.

        Raises:
            DivergedError: a force was not finite.
            CouplingError: the water had stopped acting, because another callback took its place.
        """
        if self._remove is not None:
            silenced = bool(self.model.opt.disableflags & ACTUATION)
            self._end()
            if not sys.is_finalizing():
                if silenced:
                    raise CouplingError(SILENCED)
                self.check()

    def _end(self) -> None:
        """End the water without a word."""
        remove, self._remove = self._remove, None
        if remove is not None and not sys.is_finalizing():  # then nothing is stepped any more
            self._entry.replaced |= not remove()
            if self.surface is not None:
                detach_surface(self.surface)
            if self._data is not None and self._before is not None:
                self._data.xfrc_applied[list(self.bodies)] = self._before

    def __enter__(self) -> Coupling:
        self.open()
        self._depth += 1
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._depth -= 1
        if self._depth <= 0:
            self._depth = 0
            if kind is None:
                self.close()
            else:
                self._end()  # what went wrong already must not be hidden

    def check(self) -> None:
        """Raise, or warn once, if something went wrong since the water was let act.

        Raises:
            DivergedError: a force was not finite; with the first such body and its time.
            CouplingError: the water stopped acting, because another callback took its place.
        """
        self._check_callback()
        entry = self._entry
        if entry.failed is not None:
            body, when = entry.failed
            name = body_name(self.model, body)
            raise DivergedError(
                f"the water's force on body {name!r} is not finite at t = {when:.6g} s: use a smaller "
                "time step or a slower throw",
                body=name,
                time=when,
            )
        if entry.limited is not None:
            body, when, needed = entry.limited
            self._warn(
                "step",
                too_large_step(
                    body_name(self.model, body), float(self.model.opt.timestep), needed, when
                ),
            )
        for text in gravity_warnings(self.model.opt.gravity):
            if text not in self.warnings:
                self._warn("gravity", text)
        for body, now, before in zip(self.bodies, self._shapes(), self._shapes_before, strict=True):
            if now != before:
                self._warn(
                    f"shape {body}",
                    f"geoms or the centre of mass of body {body_name(self.model, body)!r} were changed after attach(), and "
                    "the water acts on the hull that it had: close(), and attach() again",
                )
        if entry.copy_was_stepped:
            self._warn(
                "copy",
                "a copy of this model, or one compiled from the same source, was stepped without water: attach() it "
                "too, or let a Batch step this very model by batch.set_models(model)",
            )

    def _shapes(self) -> list[bytes]:
        """What hulls are made of and where they are, of every wet body, to see whether it was changed."""
        model = self.model
        found = []
        for wet in self.wet:
            members, geoms = list(wet.members), list(wet.geoms)
            arrays = [model.body_ipos[members], model.geom_size[geoms]]
            arrays += [model.geom_pos[geoms], model.geom_quat[geoms]]
            arrays += [model.body_pos[members[1:]], model.body_quat[members[1:]]]
            found.append(b"".join(array.tobytes() for array in arrays))
        return found

    def _check_callback(self) -> None:
        if self._remove is not None and self.model.opt.disableflags & ACTUATION:
            raise CouplingError(SILENCED)
        if self._remove is not None and not callback.is_acting(self):
            self._entry.replaced = True
        if self._entry.replaced:
            raise CouplingError(
                "the water stopped acting: mujoco.set_mjcb_control() was called while it was attached, and the last "
                "force stayed in xfrc_applied; set callbacks before attach(), which calls them too, or close() first"
            )

    def _warn(self, key: str, text: str) -> None:
        if key not in self._told:
            self._told.add(key)
            warnings.warn(text, MjskipWarning, stacklevel=4)

    def replace_loads(self, function: int, context: Array) -> None:
        """Let a C function void(context, model, data) set the wrenches of all bodies in `xfrc_applied` instead.

        Args:
            function: its address.
            context: numbers of any shape and unit that it is given the address of; must stay alive.
        """
        self._entry.replace_loads(function, context)

    def wrench(self, data: mujoco.MjData, body: int | str) -> Wrench:
        """Wrench of water and air on a wet body, by name or id, in the pose and motion of `data`.

        Torques are about the centre of mass of the bodies that are welded together.

        Raises:
            SceneError: the water does not act on such a body, or the data belong to another model.
            CouplingError: the water stopped acting.
        """
        return self._wrench(data, self._index(body))

    def wrenches(self, data: mujoco.MjData) -> dict[str, Wrench]:
        """Wrench on every wet body, by name, or by number where it has none.

        Args:
            data: pose and motion.
        """
        return {
            body_name(self.model, body): self._wrench(data, k) for k, body in enumerate(self.bodies)
        }

    def tree_wrench(self, data: mujoco.MjData, body: int | str | None = None) -> Wrench:
        """The sum over a whole tree, torques about its centre of mass.

        Args:
            data: pose and motion.
            body: any body of the tree; the first wet body's if None.
        """
        root, rows = self._tree(body)
        parts = [self._wrench(data, k) for k in rows]
        centre = np.array(data.subtree_com[root])
        arms = [self.centre(data, k) - centre for k in rows]
        wetted = sum(p.wetted_area for p in parts)
        return Wrench(
            force=np.sum([p.force for p in parts], axis=0),
            torque=np.sum(
                [p.torque + np.cross(r, p.force) for p, r in zip(parts, arms, strict=True)], axis=0
            ),
            air_force=np.sum([p.air_force for p in parts], axis=0),
            air_torque=np.sum(
                [p.air_torque + np.cross(r, p.air_force) for p, r in zip(parts, arms, strict=True)],
                axis=0,
            ),
            wetted_area=wetted,
            wetted_centre=np.sum([p.wetted_area * p.wetted_centre for p in parts], axis=0) / wetted
            if wetted > 0.0
            else centre,
            clearance=min(p.clearance for p in parts),
        )

    def hydrostatics(self, data: mujoco.MjData, body: int | str | None = None) -> Hydrostatics:
        """Displaced volume, centre of buoyancy, wetted area, metacentric heights in still water.

        Args:
            data: pose.
            body: any body of the tree that is asked about; the first wet body's if None.

        Overlaps between bodies across a joint count twice, as they do in the forces.
        """
        self._check_data(data)
        root, _ = self._tree(body)
        ahead = data.xmat[root].reshape(3, 3)[:, 0]
        return hydrostatics(
            self.triangles(data, root),
            centre_of_mass=data.subtree_com[root],
            heading=float(np.arctan2(ahead[1], ahead[0])),
        )

    def triangles(self, data: mujoco.MjData, body: int | str | None = None) -> Array:
        """Corners (n, 3, 3) of all hulls of a tree, world [m].

        Args:
            data: the pose.
            body: name or id of a body of the tree; the first wet body's if None.
        """
        self._check_data(data)
        _, rows = self._tree(body)
        placed = [
            self.hulls[k].triangles @ data.xmat[self.bodies[k]].reshape(3, 3).T
            + self.centre(data, k)
            for k in rows
        ]
        return np.concatenate(placed)

    def report(self, data: mujoco.MjData | None = None) -> Any:
        """What is wet and why, body by body: see `mjskip.coupling.report.Report`.

        Args:
            data: the pose; `qpos0` if None.
        """
        if data is not None:
            self._check_data(data)
        from mjskip.coupling.report import report_of

        return report_of(self, data)

    def _tree(self, body: int | str | None) -> tuple[int, list[int]]:
        """Root of a tree, and the rows of its wet bodies."""
        if body is None:
            body = self.bodies[0]
        root = int(self.model.body_rootid[body_id(self.model, body)])
        rows = [k for k, b in enumerate(self.bodies) if int(self.model.body_rootid[b]) == root]
        if not rows:
            raise SceneError(f"no body of the tree of {body_name(self.model, root)!r} is in water")
        return root, rows

    def _index(self, body: int | str) -> int:
        """Row of a wet body; one that is welded to it means it too."""
        number = find_body(self.model, body) if isinstance(body, str) else body
        for k, wet in enumerate(self.wet):
            if number == wet.body:
                return k
        for k, wet in enumerate(self.wet):
            if number in wet.members:
                return k
        has = ", ".join(f"{body_name(self.model, b)!r} ({b})" for b in self.bodies)
        raise SceneError(f"body {body!r} is not attached: the water acts on {has}")

    def _row(self, k: int) -> int:
        return check_count("k", k, low=0, high=len(self.bodies) - 1)

    def _check_data(self, data: mujoco.MjData) -> None:
        check_type("data", data, mujoco.MjData, "give the mujoco.MjData of the attached model")
        if not _same_model(self.model, data.model):
            raise SceneError(
                "this data belongs to another model than the one that is attached: give data of the attached model"
            )

    def centre(self, data: mujoco.MjData, k: int) -> Array:
        """Centre of mass of welded bodies (3,), world [m].

        Args:
            data: of the attached model.
            k: row of the wet body, as in `bodies`.
        """
        self._check_data(data)
        k = self._row(k)
        body = self.bodies[k]
        return np.asarray(data.xpos[body] + data.xmat[body].reshape(3, 3) @ self.inertias[k].centre)

    def _wrench(self, data: mujoco.MjData, k: int) -> Wrench:
        self._check_data(data)
        self._check_callback()
        self._entry.follow_gravity(self.records[k], self.blocks[k])
        found = wrench_of(self.blocks[k], self.state(data, k))
        if self.surface is None:
            return found
        load = self.surface.load_on(self.bodies[k], self.surface.state_of(data))
        return found if load is None else replace(found, force=load[:3], torque=load[3:])

    def state(self, data: mujoco.MjData, k: int) -> Array:
        """State (1, 18) of a wet body, for the force kernel: SI units, see `mjskip.rigid.state`.

        Args:
            data: of the attached model.
            k: row of the wet body, as in `bodies`.
        """
        self._check_data(data)
        k = self._row(k)
        body = self.bodies[k]
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        rotation = data.xmat[body].reshape(1, 3, 3)
        centre, moving = data.xipos[body][None], velocity[None, 3:]
        offset = self._entry.offsets[k]
        if offset is not None:
            away = rotation[0] @ offset
            centre, moving = centre + away, moving + np.cross(velocity[:3], away)
        return pack_states(centre, rotation, moving, velocity[None, :3])


def attach(
    model: mujoco.MjModel,
    data: mujoco.MjData | None = None,
    *,
    water: Water | None = None,
    bodies: BodyRule = None,
    geoms: GeomRule = None,
    resolution: int = primitives.RESOLUTION,
    max_faces: int = HullOptions.max_faces,
    interior: Interior = "flooded",
    strict: bool = False,
    native: bool = True,
    sea: Sea | str | None = None,
    surface: str = "still",
) -> Coupling:
    """Let still water (z = 0) and air act on bodies of a model.

    The forces are worked out inside MuJoCo at every evaluation, RK4's sub-stages included, and assigned
    to `xfrc_applied` of the wet bodies, for every MjData that is stepped with this very model:
    also in `mujoco.rollout` and, after `batch.set_models(model)`, in `mujoco.batch.Batch`. What a user
    (or a viewer's mouse) puts there for a wet body is overwritten; other bodies keep theirs. Gravity is followed
    when it changes; mass, inertia and geoms are read once, here.

    Args:
        model: compiled model.
        data: its `xfrc_applied` of the wet bodies is put back at the end; may be None.
        water: the fluid; `Water()` if omitted; `Water.floating()` for what floats.
        bodies: names, ids, "all" that move, "group N" (with a geom of the group), or a function of (model, id);
            all moving bodies of trees whose root has a free joint if None. What is welded to a body belongs
            to it.
        geoms: names, ids, "all", "collision", "group N", or a function of (model, id); of every body the
            colliding ones, or all if none collides, if None.
        resolution: segments around round geoms; their volume is exact.
        max_faces: hulls of more faces are simplified to this many, 0 keeps all; see `Coupling.report`.
        interior: "flooded"; for open boats without water inside "deck" or "convex", see
            `mjskip.coupling.wet.HullOptions`.
        strict: refuse open meshes; otherwise their convex hull is taken, with a warning each.
        native: False installs a callback in plain Python, for teaching and tests: far slower, and no model can
            be compiled, nor threads be used, while it is there.
        sea: waves and current, or their text as "hs=0.3 tp=3", about bodies that radiate (`Water.radiation`): the
            roots of trees. Their force goes to `qfrc_passive` and their added mass to MuJoCo's mass matrix. Waves
            that they make are kept here for each MjData, and are calm again when its time jumps: use the plugin
            where states are copied.
        surface: "still": water that moves is state of MjData, which only the plugin of a model can have; see
            `mjskip.add_water`.

    Returns:
        The coupling. It acts at once, until it is closed or left as a context; both raise if a force was not
        finite or the callback was replaced.

    Raises:
        SceneError: no such body, nothing that can be wet, a model that silences callbacks, or one that is
            attached already.
        MeshError: a mesh geom is not closed (strict).
        ValueError: an argument is of no kind that is allowed.
    """
    if surface != "still":
        raise fault(
            "surface", surface, "attach() has still water; for water that moves use mjskip.add_water(spec, "
            f"surface={surface!r}) before the model is compiled"
        )  # fmt: skip
    options = HullOptions(
        resolution=resolution, max_faces=max_faces, interior=interior, strict=strict
    )
    coupling = Coupling(
        model,
        data,
        Water() if water is None else water,
        bodies=bodies,
        geoms=geoms,
        options=options,
        native=native,
        sea=Sea.from_text(sea, gravity=_gravity(model)) if isinstance(sea, str) else sea,
    )
    for text in coupling.warnings:
        warnings.warn(text, MjskipWarning, stacklevel=2)
    return coupling.open()


def _check_arguments(model: Any, data: Any, water: Any) -> None:
    check_type("model", model, mujoco.MjModel, "give what mujoco.MjModel.from_xml_path(file) makes")
    if data is not None:
        check_type("data", data, mujoco.MjData, "give mujoco.MjData(model), or leave it out")
        if not _same_model(model, data.model):
            raise SceneError(
                "this data belongs to another model: make it with mujoco.MjData(model)"
            )
    check_type("water", water, Water, "give a mjskip.Water, such as Water.floating()")


def _check_sea(model: mujoco.MjModel, water: Water, sea: Any, native: bool) -> None:
    """A sea needs bodies that radiate, and they a compiled callback and the model's gravity."""
    if sea is not None:
        check_type("sea", sea, Sea, 'give a mjskip.Sea, or a text such as "hs=0.3 tp=3"')
        if not water.radiation:
            raise ValueError(
                "sea is given and the water's radiation is off: waves act on bodies that radiate; use "
                "Water.floating(radiation=True)"
            )
        if abs(sea.gravity - _gravity(model)) > 1e-9 * sea.gravity:
            raise ValueError(
                f"sea has a gravity of {sea.gravity:g} m/s^2 and the model one of {_gravity(model):g}: give them one"
            )
    if water.radiation and not native:
        raise ValueError(
            "native is False and the water's radiation is on: only compiled code radiates"
        )


def _gravity(model: mujoco.MjModel) -> float:
    return float(-model.opt.gravity[2])


def _same_model(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether two models are one, or copies of which nothing that poses bodies was altered."""
    if model._address == other._address:
        return True
    return model.signature == other.signature and all(
        np.array_equal(a, b) for a, b in zip(_posing(model), _posing(other), strict=True)
    )


def _posing(model: mujoco.MjModel) -> Iterator[Any]:
    yield from (model.body_pos, model.body_ipos, model.body_mass, model.geom_size, model.geom_pos)
    yield from (model.jnt_pos, model.jnt_axis, model.mesh_vert)


def _refuse_plugged(model: mujoco.MjModel, members: tuple[int, ...]) -> None:
    for body in members:
        if plugin_water(model, body) is not None:
            raise SceneError(
                f"body {body_name(model, body)!r} has its water from plugin mjskip.water: name others with "
                "bodies=, or take the plugin out of the model"
            )
