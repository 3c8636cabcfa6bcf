"""Put still water on the bodies of a MuJoCo Warp model."""

from __future__ import annotations

import copy
import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
import warp as wp

from mjskip._typing import Array
from mjskip.checks import check_type
from mjskip.coupling._struct_layout import members
from mjskip.coupling.bodies import body_name
from mjskip.coupling.plugin_keys import NAME, plugin_bodies, plugin_water
from mjskip.coupling.selection import select
from mjskip.coupling.wet import HullOptions, hull_of, inertia_of
from mjskip.errors import SceneError
from mjskip.hydro._block import OUTLINE
from mjskip.hydro.hull import Hull
from mjskip.hydro.laws import LAWS
from mjskip.hydro.packing import pack, planes_of
from mjskip.hydro.water import Water
from mjskip.warp import _integral_kernels as integrals
from mjskip.warp import _kernels as kernels


def strip_plugin(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of a compiled model without plugin mjskip.water, which MuJoCo Warp would refuse.

    The plugin's sensors become user sensors, which show zeros. Give `attach` the original.

    Raises:
        SceneError: the model has plugins of others too, which Warp does not know either.
    """
    bare = copy.copy(check_type("model", model, mujoco.MjModel, "give a compiled mujoco.MjModel"))
    ours = {
        int(model.body_plugin[body])
        for body in range(model.nbody)
        if plugin_water(model, body) is not None
    }
    if set(range(model.nplugin)) - ours:
        raise SceneError(
            f"this model has plugins besides {NAME}: take them out of its MJCF, MuJoCo Warp cannot run them"
        )
    bare.body_plugin[:] = -1
    bare.sensor_type[bare.sensor_plugin >= 0] = mujoco.mjtSensor.mjSENS_USER
    bare.sensor_plugin[:] = -1
    # the bindings let no one write a size; put_model wants none where it finds no plugin
    place = members("mjModel")["nplugin"]
    ctypes.c_int64.from_address(bare._address + place.offset).value = 0
    return bare


def attach(
    warp_model: Any,
    mujoco_model: mujoco.MjModel,
    *,
    water: Water | None = None,
    bodies: Sequence[str | int] | None = None,
) -> WarpWater:
    """Let still water (z = 0) and air act on bodies of every world that is stepped with `warp_model`.

    The forces go to `qfrc_passive` by `callback.passive`, which MuJoCo Warp calls at every evaluation, the sub-stages of
    RK4 included. A callback that is there already is called before.

    Args:
        warp_model: from `mujoco_warp.put_model`.
        mujoco_model: the model it was made of, before `strip_plugin`: its mass, inertia and geoms are read here, once.
        water: the fluid. If omitted, bodies that carry plugin mjskip.water have what the plugin says; `Water()` if there
            are none. It is still: what radiates is not known here.
        bodies: names or ids of the bodies. If omitted, those of the plugin, or else all moving bodies of free trees.

    Returns:
        The water, with wrenches of the last evaluation, which can be detached.

    Raises:
        SceneError: no such body, or none at all.
        ValueError: water that is not known here, or an argument of a wrong type.
    """
    check_type("mujoco_model", mujoco_model, mujoco.MjModel, "give a compiled mujoco.MjModel")
    if not hasattr(getattr(warp_model, "callback", None), "passive"):
        raise ValueError(
            f"warp_model is a {type(warp_model).__name__}: give what mujoco_warp.put_model returns"
        )
    wet = _wet_bodies(mujoco_model, water, bodies)
    found = WarpWater(
        bodies=tuple(one.body for one in wet),
        names=tuple(body_name(mujoco_model, one.body) for one in wet),
        _model=warp_model,
        _device=warp_model.qpos0.device,
        _before=warp_model.callback.passive,
    )
    found._upload(mujoco_model, wet)
    warp_model.callback.passive = found
    return found


@dataclass(eq=False)
class WarpWater:
    """Water on bodies of a Warp model; `callback.passive` of that model.

    Attributes:
        bodies: their ids.
        names: their names.
        force: of water and air (worlds, bodies) of vec3, world axes [N]; at the last evaluation, on the device.
        torque: the same about the centres of mass [N m].
        wetted_area: (worlds, bodies) [m^2].
    """

    bodies: tuple[int, ...]
    names: tuple[str, ...]
    force: Any = None
    torque: Any = None
    wetted_area: Any = None
    _model: Any = field(default=None, repr=False)
    _device: Any = field(default=None, repr=False)
    _before: Callable[[Any, Any], None] | None = field(default=None, repr=False)
    _laws: Any = field(default=None, repr=False)
    _segments: Any = field(default=None, repr=False)
    _max_edges: int = field(default=0, repr=False)

    def __call__(self, m: Any, d: Any) -> None:
        """Add the water's forces to `d.qfrc_passive`."""
        if self._before is not None:
            self._before(m, d)
        worlds, count = d.nworld, len(self.bodies)
        if self.force is None or self.force.shape[0] != worlds:
            self.force = wp.zeros((worlds, count), dtype=wp.vec3, device=self._device)
            self.torque = wp.zeros_like(self.force)
            self.wetted_area = wp.zeros((worlds, count), dtype=float, device=self._device)
        wp.launch(
            kernels.wet_wrench,
            dim=(worlds, count),
            inputs=[
                self._bodies, *self._corners, self._normals, self._areas, m.body_rootid,
                m.opt.gravity, d.xpos, d.xmat, d.cvel, d.subtree_com,
            ],
            outputs=[self.force, self.torque, self.wetted_area],
            device=self._device,
        )  # fmt: skip
        if self._laws is not None:
            self._add_face_laws(m, d)
        wp.launch(
            kernels.add_to_passive,
            dim=(worlds, m.nv),
            inputs=[
                self._bodies, self._moves, m.body_rootid, d.xpos, d.xmat, d.subtree_com, d.cdof,
                self.force, self.torque,
            ],
            outputs=[d.qfrc_passive],
            device=self._device,
        )  # fmt: skip

    def _add_face_laws(self, m: Any, d: Any) -> None:
        """Loads of laws that are integrated over faces."""
        shape = (d.nworld, self._laws.shape[0])
        if self._segments is None or self._segments.shape[0] != d.nworld:
            room = (*shape, max(2 * self._max_edges, 1))
            self._segments = wp.zeros(room, dtype=wp.vec4, device=self._device)
            self._crossings = wp.zeros(room, dtype=wp.vec3, device=self._device)
        wp.launch(
            integrals.add_face_laws,
            dim=shape,
            inputs=[
                self._laws, self._bodies, *self._corners, self._normals, self._planes, *self._edges,
                m.body_rootid, d.xpos, d.xmat, d.cvel, d.subtree_com,
                self._segments, self._crossings,
            ],
            outputs=[self.force, self.torque],
            device=self._device,
        )  # fmt: skip

    def detach(self) -> None:
        """Take the water away; the callback that was there before is back."""
        if self._model.callback.passive is self:
            self._model.callback.passive = self._before

    def _upload(self, model: mujoco.MjModel, wet: list[_Wet]) -> None:
        """Triangles and constants to the device."""
        triangles = [one.hull.triangles for one in wet]
        vectors = np.vstack([one.hull.area_vectors for one in wet])
        areas = np.linalg.norm(vectors, axis=1)
        corners = np.concatenate(triangles)
        first = np.cumsum([0, *map(len, triangles)])
        rows = [_constants(one, int(at)) for one, at in zip(wet, first[:-1], strict=True)]
        device = self._device
        self._bodies = wp.array(rows, dtype=kernels.WetBody, device=device)
        self._corners = [
            wp.array(corners[:, k].astype(np.float32), dtype=wp.vec3, device=device) for k in range(3)
        ]  # fmt: skip
        normals = (vectors / areas[:, None]).astype(np.float32)
        self._normals = wp.array(normals, dtype=wp.vec3, device=device)
        self._areas = wp.array(areas.astype(np.float32), dtype=float, device=device)
        self._moves = wp.array(_moved(model, list(self.bodies)), dtype=int, device=device)
        self._upload_face_laws(wet)

    def _upload_face_laws(self, wet: list[_Wet]) -> None:
        """Laws that are integrated over faces, and the plane faces of bodies whose law acts forward."""
        laws: list[Any] = []
        planes: list[Any] = []
        edges: list[Array] = [np.zeros((0, 6))]
        for number, one in enumerate(wet):
            if not _integrated(one.water):
                continue
            law = _face_law(one, number)
            if law.forward:
                faces = planes_of(pack(one.hull, one.water))
                law.first, law.count = len(planes), len(faces)
                for face in faces:
                    outline = face[OUTLINE:].reshape(-1, 6)
                    planes.append(_plane_face(face, sum(map(len, edges)), len(outline)))
                    edges.append(outline)
                    self._max_edges = max(self._max_edges, len(outline))
            laws.append(law)
        if not laws:
            return
        device = self._device
        ends = np.concatenate(edges).astype(np.float32)
        self._laws = wp.array(laws, dtype=integrals.FaceLaw, device=device)
        self._planes = wp.array(planes, dtype=integrals.PlaneFace, device=device)
        self._edges = [
            wp.array(ends[:, :3].copy(), dtype=wp.vec3, device=device),
            wp.array(ends[:, 3:].copy(), dtype=wp.vec3, device=device),
        ]


@dataclass(frozen=True, eq=False)
class _Wet:
    """A wet body: its id, its centre of mass in its own frame, its hull and its fluid."""

    body: int
    centre: Array
    hull: Hull
    water: Water


def _wet_bodies(
    model: mujoco.MjModel, water: Water | None, bodies: Sequence[str | int] | None
) -> list[_Wet]:
    """Every body the water acts on: those of the plugin, or as `mjskip.attach` chooses them."""
    found = [] if bodies is not None else plugin_bodies(model)
    if not found:
        for one in select(model, bodies).wet:
            inertia = inertia_of(model, one.body, one.members)
            built = hull_of(model, one, HullOptions(), inertia)
            found.append((one, inertia, built, water or Water()))
    wet = [
        _Wet(one.body, inertia.centre, built.hull, water or fluid)
        for one, inertia, built, fluid in found
        if built.hull is not None
    ]
    if not wet:
        raise SceneError("this model has no geom for water to act on")
    for each in wet:
        _check_known(each.water)
    return wet


def _check_known(water: Water) -> None:
    """Refuse what is not here."""
    if water.radiation:
        raise ValueError(
            "radiation is True: for Warp water is still; use Water.floating(), which bears and rubs"
        )
    if water.added_mass:
        raise ValueError(f"added_mass is {water.added_mass:g}: for Warp leave it out")


def _integrated(water: Water) -> bool:
    """Whether the law's load is integrated over faces, not taken at the centroids of triangles."""
    return LAWS[water.law].forward or water.quadrature


def _face_law(one: _Wet, number: int) -> Any:
    water, law = one.water, LAWS[one.water.law]
    found = integrals.FaceLaw()
    found.wet, found.forward, found.local = number, int(law.forward), int(water.gate == "local")
    found.squared = water.density * law.normal_squared
    found.mixed = water.density * law.speed_normal
    found.plain = water.density * law.speed_squared
    found.friction = water.density * law.friction
    found.cavity = water.density * law.cavity
    return found


def _plane_face(face: Array, first: int, count: int) -> Any:
    found = integrals.PlaneFace()
    found.normal, found.distance = wp.vec3(*face[:3]), float(face[3])
    found.first, found.count = first, count
    return found


def _constants(one: _Wet, first: int) -> Any:
    stone, water, law = one.hull, one.water, LAWS[one.water.law]
    wet = kernels.WetBody()
    wet.body, wet.first, wet.count = one.body, first, len(stone.faces)
    wet.centre = wp.vec3(*one.centre)
    wet.radius = stone.radius
    wet.local = int(water.gate == "local")
    if not _integrated(water):
        wet.squared = water.density * law.normal_squared
        wet.mixed = water.density * law.speed_normal
        wet.plain = water.density * law.speed_squared
        wet.friction = water.density * law.friction
    wet.weight = water.density if water.buoyancy else 0.0
    wet.skin = water.density if water.skin_friction else 0.0
    wet.viscosity = water.viscosity
    wet.length = 2.0 * float(np.sqrt(stone.disc_area / np.pi))
    wet.air = water.air_density * stone.disc_area
    wet.disc_normal = wp.vec3(*stone.disc_normal)
    wet.disc_centre = wp.vec3(*stone.disc_centre)
    return wet


def _moved(model: mujoco.MjModel, bodies: list[int]) -> npt.NDArray[np.int32]:
    """Which degrees of freedom move which body: (nv, bodies) of 0 and 1."""
    moves = np.zeros((model.nv, len(bodies)), np.int32)
    for k, body in enumerate(bodies):
        while body > 0 and model.body_dofnum[body] == 0:
            body = int(model.body_parentid[body])
        dof = int(model.body_dofadr[body] + model.body_dofnum[body]) - 1 if body > 0 else -1
        while dof >= 0:
            moves[dof, k] = 1
            dof = int(model.dof_parentid[dof])
    return moves
