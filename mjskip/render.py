"""Draw what happened: replay a trajectory into pictures of the stone and the water it moved."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip.errors import RenderError, SceneError
from mjskip.gl import gl_renderer as gl_renderer
from mjskip.gl import is_software as is_software
from mjskip.gl import offscreen
from mjskip.skin import Grid, Surface, WaterSkin, add_water
from mjskip.trajectory import Trajectory
from mjskip.video import (
    Image,
    Progress,
    check_folder,
    check_fps,
    check_size,
    check_video_path,
    write_pngs,
    write_video,
)
from mjskip.wake import Wake

if TYPE_CHECKING:
    from mjskip.scene import Scene

Array = npt.NDArray[np.float64]
Flights = Trajectory | Mapping[str, Trajectory]
"""The motion of the scene's chosen stone, or of several by the names of their bodies."""

_HIDDEN = 5  # a geom group that MuJoCo does not draw by default
_STEP = 0.3  # of the stone's radius: between vertices near it, if the water's cells are no larger


def render_video(
    scene: Scene,
    trajectory: Flights,
    path: str | Path,
    *,
    camera: str = "side",
    size: tuple[int, int] = (640, 480),
    fps: float = 30.0,
    slow: float = 1.0,
    progress: Progress | None = None,
) -> Path:
    """Write an h264 video of a throw.

    Args:
        scene: where it was thrown.
        trajectory: what the stone did; a mapping from body names when there are several stones.
        path: .mp4, .mkv or .mov in a folder that exists.
        camera: by its name in the scene.
        size: width and height, even [pixels].
        fps: frames per second.
        slow: how many times slower than it was; 1 is its own speed.
        progress: called with the frames done and to do.

    Returns:
        The path.

    Raises:
        ValueError: a size, rate, name or folder that cannot be used.
        SceneError: the scene has no such camera or body.
        RenderError: OpenGL or the encoder is missing or fails.
    """
    path = Path(path)
    check_video_path(path)
    images = frames(scene, trajectory, camera=camera, size=size, fps=fps, slow=slow)
    with contextlib.closing(images):
        return write_video(
            images,
            path,
            size=size,
            fps=fps,
            total=len(frame_times(trajectory, fps=fps, slow=slow)),
            progress=progress,
        )


def render_frames(
    scene: Scene,
    trajectory: Flights,
    folder: str | Path,
    *,
    camera: str = "side",
    size: tuple[int, int] = (640, 480),
    fps: float = 30.0,
    slow: float = 1.0,
    progress: Progress | None = None,
) -> list[Path]:
    """Write a throw as frame_0000.png and so on into a folder that exists; see `render_video`."""
    folder = Path(folder)
    check_folder(folder)
    images = frames(scene, trajectory, camera=camera, size=size, fps=fps, slow=slow)
    with contextlib.closing(images):
        return write_pngs(
            images,
            folder,
            total=len(frame_times(trajectory, fps=fps, slow=slow)),
            progress=progress,
        )


def frames(
    scene: Scene,
    trajectory: Flights,
    *,
    camera: str = "side",
    size: tuple[int, int] = (640, 480),
    fps: float = 30.0,
    slow: float = 1.0,
) -> Generator[Image, None, None]:
    """The pictures (height, width, 3) of a throw, one at a time; see `render_video`.

    Rigid bodies are only placed, never stepped. The water starts still and gets back, between
    pictures, what it gave to the stones.
    """
    check_size(size)
    times = frame_times(trajectory, fps=fps, slow=slow)
    flights = _by_body(scene, trajectory)
    field = scene.field()
    body = scene.body if scene.body in flights else next(iter(flights))
    grid = Grid.around(step=max(field.spacing, _STEP * _radius(scene.model, body)))
    stage = Stage(scene, flights, camera=camera, size=size, grid=grid)
    # the stage opens here, not at the first picture: what is wrong shows before a file is begun
    stage.open()
    wake = Wake(field, list(flights.values()), density=scene.water.density)
    return _play(stage, field, wake, times)


def _play(stage: Stage, field: Any, wake: Wake, times: Array) -> Generator[Image, None, None]:
    with contextlib.closing(stage):
        wake.time = float(times[0])
        for time in times:
            wake.advance(float(time))
            yield stage.draw(float(time), field)


def frame_times(trajectory: Flights, *, fps: float = 30.0, slow: float = 1.0) -> Array:
    """When the pictures of a throw are taken (n,) [s]: from its first row to its last."""
    check_fps(fps)
    if not 1.0 <= slow <= 1000.0:
        raise ValueError(f"slow is {slow!r}: give how many times slower, from 1 to 1000")
    several = list(trajectory.values()) if isinstance(trajectory, Mapping) else [trajectory]
    if not several or any(len(one.time) == 0 for one in several):
        raise ValueError("the trajectory has no rows: nothing to draw")
    start = min(float(one.time[0]) for one in several)
    stop = max(float(one.time[-1]) for one in several)
    rate = fps * slow
    return start + np.arange(math.floor((stop - start) * rate + 1e-6) + 1) / rate


def _by_body(scene: Scene, trajectory: Flights) -> dict[str, Trajectory]:
    if isinstance(trajectory, Mapping):
        return dict(trajectory)
    return {scene.body: trajectory}


class Stage:
    """A scene made ready to draw: its own model with the water in it, a camera, a GL context.

    Attributes:
        model: the scene's, with the skin.
        data: the poses of the last picture.
    """

    def __init__(
        self,
        scene: Scene,
        flights: Mapping[str, Trajectory],
        *,
        camera: str,
        size: tuple[int, int],
        grid: Grid,
    ) -> None:
        self._flights = dict(flights)
        self._size = size
        self._focus = scene.body if scene.body in self._flights else next(iter(self._flights))
        spec = mujoco.MjSpec.from_file(str(scene.path))
        add_water(spec, grid)
        self.model = spec.compile()
        self._camera = check_camera(self.model, camera)
        self._addresses = {name: _free_joint(self.model, name) for name in self._flights}
        _hide_others(self.model, self._addresses)
        wide, high = size
        self.model.vis.global_.offwidth = max(wide, self.model.vis.global_.offwidth)
        self.model.vis.global_.offheight = max(high, self.model.vis.global_.offheight)
        self._skin = WaterSkin(self.model, grid)
        self.data = mujoco.MjData(self.model)
        self._camera_height = self._height_in_scene()
        self._renderer: Any = None

    def open(self) -> None:
        """Make the GL context.

        Raises:
            RenderError: none can be made here.
        """
        with offscreen():
            self._renderer = mujoco.Renderer(self.model, height=self._size[1], width=self._size[0])

    def close(self) -> None:
        """Free the GL context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def draw(self, time: float, surface: Surface) -> Image:
        """The picture (height, width, 3) of one moment [s]."""
        if self._renderer is None:
            raise RenderError("the stage is closed: open it before drawing")
        for name, flight in self._flights.items():
            position, attitude = pose_at(flight, time)
            body = self.model.body(name)
            at = self._addresses[name]
            self.data.qpos[at : at + 3] = position - _rotated(body.ipos, attitude)
            self.data.qpos[at + 3 : at + 7] = attitude
        self._place()
        if self._camera_height is not None:
            self.data.cam_xpos[self._camera, 2] = self._camera_height
        renderer = self._renderer
        renderer.update_scene(self.data, camera=self._camera)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            renderer.scene.flags[flag] = 0  # each redraws everything; skins show neither
        x, y, _ = pose_at(self._flights[self._focus], time)[0]
        self._skin.draw(renderer.scene, surface, focus=(float(x), float(y)))
        image: Image = renderer.render()
        return image

    def _place(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _height_in_scene(self) -> float | None:
        """A camera that follows a stone does so level: it neither bobs nor dives with it [m]."""
        following = mujoco.mjtCamLight.mjCAMLIGHT_TRACK, mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM
        if int(self.model.cam_mode[self._camera]) not in map(int, following):
            return None
        self._place()
        return float(self.data.cam_xpos[self._camera, 2])


def pose_at(flight: Trajectory, time: float) -> tuple[Array, Array]:
    """Centre of mass (3,) [m] and orientation (4,) between two rows; held beyond the ends."""
    after = int(np.clip(np.searchsorted(flight.time, time), 1, max(len(flight.time) - 1, 1)))
    if len(flight.time) == 1:
        return flight.x[0], flight.q[0]
    earlier, later = flight.time[after - 1], flight.time[after]
    share = min(max((time - earlier) / (later - earlier), 0.0), 1.0) if later > earlier else 1.0
    before = flight.q[after - 1]
    # q and -q are one attitude: blend the nearer pair
    beyond = flight.q[after] * (1.0 if before @ flight.q[after] >= 0.0 else -1.0)
    attitude = (1.0 - share) * before + share * beyond
    position = (1.0 - share) * flight.x[after - 1] + share * flight.x[after]
    return position, attitude / np.linalg.norm(attitude)


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


def _radius(model: Any, name: str) -> float:
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
