"""A scene made ready to draw: stones in their places, water, a camera, a GL context."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, get_args

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip.draw.canvas import Canvas
from mjskip.draw.optics import Eye, Lake
from mjskip.draw.scenery import ellipsoids_of, lake_of
from mjskip.draw.skin import Grid, Surface, WaterSkin, add_water
from mjskip.draw.video import Image
from mjskip.errors import RenderError, SceneError
from mjskip.throws.trajectory import Trajectory, pose_at

if TYPE_CHECKING:
    from mjskip.throws.scene import Scene

Array = npt.NDArray[np.float64]
Look = Literal["shaded", "plain"]
LOOKS: tuple[Look, ...] = get_args(Look)

_GOES_ON = ("planing", "out of time")  # ends after which a stone moved on: it is not drawn any more
_AWAY = 1e3  # [m] below
_HIDDEN = 5  # a geom group that MuJoCo does not draw by default


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
    ) -> None:
        if look not in LOOKS:
            raise ValueError(f"look is {look!r}: use one of {', '.join(LOOKS)}")
        self._flights = dict(flights)
        self._size = size
        self._focus = scene.body if scene.body in self._flights else next(iter(self._flights))
        spec = mujoco.MjSpec.from_file(str(scene.path))
        if look == "plain":
            add_water(spec, grid)
        self.model = spec.compile()
        self._camera = check_camera(self.model, camera)
        self._addresses = {name: _free_joint(self.model, name) for name in self._flights}
        _hide_others(self.model, self._addresses)
        self._groups = self.model.geom_group.copy()
        wide, high = size
        self.model.vis.global_.offwidth = max(wide, self.model.vis.global_.offwidth)
        self.model.vis.global_.offheight = max(high, self.model.vis.global_.offheight)
        self._skin = WaterSkin(self.model, grid) if look == "plain" else None
        self.data = mujoco.MjData(self.model)
        self._place()
        self._camera_height = self._height_in_scene()
        self._look = look
        self._scene = scene
        self._lake: Lake | None = None
        self._thrown = {name: self.model.body(name).id for name in self._addresses}
        self._canvas: Canvas | None = None
        self.eye = Eye(
            position=np.zeros(3), forward=np.array([1.0, 0.0, 0.0]),
            up=np.array([0.0, 0.0, 1.0]), half_height=1.0, aspect=1.0,
        )  # fmt: skip

    def open(self) -> None:
        """Make the GL context.

        Raises:
            RenderError: none can be made here.
        """
        self._canvas = Canvas(self.model, size=self._size)
        if self._look == "shaded":
            self._lake = lake_of(
                self.model,
                self.data,
                self._canvas,
                field=self._scene.grid,
                stones=list(self._thrown.values()),
            )

    def close(self) -> None:
        """Free the GL context."""
        if self._canvas is not None:
            self._canvas.close()
            self._canvas = None

    def draw(self, time: float, surface: Surface, *, centre: Array | None = None) -> Image:
        """The picture (height, width, 3) of one moment.

        Args:
            time: [s].
            surface: of the water.
            centre: what a camera that follows looks at (3,) [m]; the stone if None.
        """
        canvas = self._canvas
        if canvas is None:
            raise RenderError("the stage is closed: open it before drawing")
        self._put_stones(time)
        if self._camera_height is not None:
            # the camera rides with the stone that is looked at, also if it is not its own
            own = self.data.xipos[self.model.cam_bodyid[self._camera]]
            ahead = self.data.xipos[self._thrown[self._focus]] if centre is None else centre
            self.data.cam_xpos[self._camera] += ahead - own
        if self._camera_height is not None:
            self.data.cam_xpos[self._camera, 2] = self._camera_height
        self._leave_out_what_is_out_of_sight()
        canvas.update(self.data, camera=self._camera)
        self.eye = canvas.eye()
        x, y, _ = pose_at(self._flights[self._focus], time)[0]
        if self._skin is not None:
            self._skin.draw(canvas.scene, surface, focus=(float(x), float(y)))
            return np.ascontiguousarray(canvas.picture()[::-1])
        return self._shaded(canvas, time, surface, (float(x), float(y)))

    def _shaded(
        self, canvas: Canvas, time: float, surface: Surface, focus: tuple[float, float]
    ) -> Image:
        assert self._lake is not None
        picture, distances = canvas.picture_and_distances()
        return self._lake.draw(
            self.eye,
            picture,
            distances,
            elevation=surface.elevation,
            spacing=surface.spacing,
            centre=surface.centre,
            stones=ellipsoids_of(self.model, self.data, list(self._thrown.values())),
            focus=focus,
            time=time,
        )

    def _leave_out_what_is_out_of_sight(self) -> None:
        """MuJoCo transforms every geom: half of a frame's time goes to what is beside the picture."""
        half = math.tan(0.5 * math.radians(float(self.model.cam_fovy[self._camera])))
        axes = self.data.cam_xmat[self._camera].reshape(3, 3)  # right, up, back
        at = (self.data.geom_xpos - self.data.cam_xpos[self._camera]) @ axes
        radius = self.model.geom_rbound
        seen = at[:, 2] < radius
        for axis, tangent in ((0, half * self._size[0] / self._size[1]), (1, half)):
            # distance beyond the side planes of the pyramid of sight
            beyond = (np.abs(at[:, axis]) + tangent * at[:, 2]) / math.hypot(1.0, tangent)
            seen &= beyond < radius
        seen |= radius == 0.0  # a plane has no end
        self.model.geom_group[:] = np.where(seen, self._groups, _HIDDEN)

    def _put_stones(self, time: float) -> None:
        for name, flight in self._flights.items():
            position, attitude = pose_at(flight, time)
            body = self.model.body(name)
            at = self._addresses[name]
            if time > flight.time[-1] and flight.end in _GOES_ON:
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
