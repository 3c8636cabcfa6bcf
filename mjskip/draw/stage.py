"""A scene made ready to draw: stones in their places, water, a camera, a GL context."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, get_args

import mujoco
import numpy as np

from mjskip._typing import Array, Image
from mjskip.draw.eye import PinholeCamera
from mjskip.draw.gl import offscreen, shaders_work
from mjskip.draw.renderer import Renderer
from mjskip.draw.skin import Grid, WaterSkin, add_water
from mjskip.draw.spray import Spray
from mjskip.draw.surface import patch_of
from mjskip.errors import MjskipWarning, RenderError, SceneError
from mjskip.throws.trajectory import Trajectory, pose_at

if TYPE_CHECKING:
    from mjskip.throws.scene import Scene

Look = Literal["shaded", "plain"]
LOOKS: tuple[Look, ...] = get_args(Look)

_GOES_ON = ("planing", "out of time")  # ends after which a stone moved on: it is not drawn any more
_AWAY = 1e3  # [m] below
_HIDDEN = 5  # a geom group that MuJoCo does not draw by default
_WET = 0.7  # of its colour that a wet stone has


class Stage:
    """A scene made ready to draw.

    Attributes:
        model: the scene's, for the plain look with the skin.
        data: the poses of the last picture.
        eye: the camera of the last picture.
    """

    def __init__(
        self,
        scene: Scene,
        flights: Mapping[str, Trajectory],
        *,
        camera: str,
        size: tuple[int, int],
        grid: Grid,
        look: Look = "shaded",
        spray: bool = True,
    ) -> None:
        if look not in LOOKS:
            raise ValueError(f"look is {look!r}: use one of {', '.join(LOOKS)}")
        self._flights, self._size, self._grid = dict(flights), size, grid
        self._focus = scene.body if scene.body in self._flights else next(iter(self._flights))
        spec = mujoco.MjSpec.from_file(str(scene.path))
        self._plain = look == "plain" or not shaders_work()
        if self._plain:
            if look != "plain":
                warnings.warn(
                    "this OpenGL does not know GLSL 3.30: drawn with the plain look",
                    MjskipWarning,
                    stacklevel=2,
                )
            add_water(spec, grid)
        self.model = spec.compile()
        self._camera = check_camera(self.model, camera)
        self._addresses = {name: _free_joint(self.model, name) for name in self._flights}
        _hide_others(self.model, self._addresses)
        wide, high = size
        self.model.vis.global_.offwidth = max(wide, self.model.vis.global_.offwidth)
        self.model.vis.global_.offheight = max(high, self.model.vis.global_.offheight)
        self.data = mujoco.MjData(self.model)
        self._place()
        self._camera_height = self._height_in_scene()
        self._thrown = {name: self.model.body(name).id for name in self._addresses}
        self._skin = WaterSkin(self.model, grid) if self._plain else None
        self._renderer: Any = None
        density = scene.water.density
        self._sprays = (
            [Spray(flight, density=density) for flight in flights.values()]
            if spray and not self._plain
            else []
        )
        self.eye = PinholeCamera(
            position=np.zeros(3), forward=np.array([1.0, 0.0, 0.0]),
            up=np.array([0.0, 0.0, 1.0]), half_height=1.0, aspect=wide / high,
        )  # fmt: skip

    def open(self) -> None:
        """Make the GL context.

        Raises:
            RenderError: none can be made here.
        """
        wide, high = self._size
        with offscreen():
            make = mujoco.Renderer if self._plain else Renderer
            self._renderer = make(self.model, high, wide)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._renderer.scene.flags[flag] = 0  # each redraws everything; the water shows neither

    def close(self) -> None:
        """Free the GL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def draw(self, time: float, surface: Any, *, centre: Array | None = None) -> Image:
        """The picture (height, width, 3) of one moment.

        Args:
            time: [s].
            surface: water, see `mjskip.draw.surface.patch_of`.
            centre: what a camera that follows looks at (3,) [m]; the stone if None.
        """
        if self._renderer is None:
            raise RenderError("the stage is closed: open it before drawing")
        self._put_stones(time)
        if self._camera_height is not None:
            # the camera rides with the stone that is looked at, also if it is not its own
            own = self.data.xipos[self.model.cam_bodyid[self._camera]]
            ahead = self.data.xipos[self._thrown[self._focus]] if centre is None else centre
            self.data.cam_xpos[self._camera] += ahead - own
            self.data.cam_xpos[self._camera, 2] = self._camera_height
        self.data.time = time
        if not self._plain:
            self._renderer.water = surface
            parts = [(spray.drops(time), spray.sheet(time)) for spray in self._sprays]
            drops, sheets = zip(*parts, strict=True) if parts else ([], [])
            self._renderer.spray = (
                (np.concatenate(drops), np.concatenate(sheets)) if parts else None
            )
        self._renderer.update_scene(self.data, self._camera)
        self._wet_stones(time)
        self.eye = PinholeCamera.of(self._renderer.scene, self._size[0] / self._size[1])
        if self._skin is not None:
            x, y, _ = pose_at(self._flights[self._focus], time)[0].tolist()
            self._skin.draw(self._renderer.scene, patch_of(surface, focus=(x, y)), focus=(x, y))
        image: Image = self._renderer.render()
        return image

    def _wet_stones(self, time: float) -> None:
        """A stone that has been under water is darker."""
        wet = {
            self._thrown[name]
            for name, flight in self._flights.items()
            if flight.contacts
            and time > flight.contacts[0].entry.time
            and not flight.attributes.get("afloat")
        }
        scene = self._renderer.scene
        for geom in scene.geoms[: scene.ngeom] if wet else ():
            if (
                geom.objtype == mujoco.mjtObj.mjOBJ_GEOM
                and self.model.geom_bodyid[geom.objid] in wet
            ):
                geom.rgba[:3] *= _WET

    def _put_stones(self, time: float) -> None:
        flight = self._flights[self._focus]
        if flight.qpos is not None and flight.qpos.shape[1] == self.model.nq:
            self.data.qpos[:] = _coordinates_at(self.model, flight.time, flight.qpos, time)
        for name, flight in self._flights.items():
            position, attitude = pose_at(flight, time)
            body = self.model.body(name)
            at = self._addresses[name]
            gone = flight.end in _GOES_ON and not flight.attributes.get("afloat")
            if gone and time > flight.time[-1]:
                position = position - np.array([0.0, 0.0, _AWAY])
            self.data.qpos[at : at + 3] = position - _rotated(body.ipos, attitude)
            self.data.qpos[at + 3 : at + 7] = attitude
        self._place()

    def _place(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _height_in_scene(self) -> float | None:
        """A camera that follows a stone does so level: it neither bobs nor dives with it [m]."""
        following = mujoco.mjtCamLight.mjCAMLIGHT_TRACK, mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM
        if int(self.model.cam_mode[self._camera]) not in map(int, following):
            return None
        return float(self.data.cam_xpos[self._camera, 2])


def _coordinates_at(model: Any, times: Array, qpos: Array, time: float) -> Array:
    """Coordinates (nq,) between two rows; held beyond the ends."""
    k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, max(len(times) - 2, 0)))
    found: Array = qpos[k].copy()
    if len(times) > 1:
        step, rate = float(times[k + 1] - times[k]), np.empty(model.nv)
        mujoco.mj_differentiatePos(model, rate, step, qpos[k], qpos[k + 1])
        part = min(max((time - float(times[k])) / step, 0.0), 1.0)
        mujoco.mj_integratePos(model, found, rate, part * step)
    return found


def _rotated(vector: Array, attitude: Array) -> Array:
    turned = np.empty(3)
    mujoco.mju_rotVecQuat(turned, vector, attitude)
    return turned


def check_camera(model: Any, name: str) -> int:
    """Id of the camera of this name.

    Raises:
        SceneError: there is none; the text lists those there are.
    """
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name)
    if index < 0:
        known = [model.camera(k).name for k in range(model.ncam) if model.camera(k).name]
        raise SceneError(
            f"the scene has no camera {name!r}: "
            + (f"use one of {', '.join(known)}" if known else "it has none with a name; add one")
        )
    return int(index)


def _free_joint(model: Any, name: str) -> int:
    """Where the pose of this body begins in qpos."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    free = [model.body(k).name for k in range(model.nbody) if _is_free(model, k)]
    if body < 0 or not _is_free(model, body):
        raise SceneError(f"the scene has no free body {name!r}: it has {', '.join(free) or 'none'}")
    return int(model.jnt_qposadr[model.body_jntadr[body]])


def _is_free(model: Any, body: int) -> bool:
    joint = model.body_jntadr[body]
    return bool(joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE)


def largest_radius(model: Any, name: str) -> float:
    """Of the largest geom of a body [m]."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    radii = model.geom_rbound[model.geom_bodyid == body]
    return float(max(radii, default=0.0))


def _hide_others(model: Any, thrown: Mapping[str, int]) -> None:
    """A stone that nobody throws would hang in the air."""
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if _is_free(model, body) and model.body(body).name not in thrown:
            model.geom_group[geom] = _HIDDEN
