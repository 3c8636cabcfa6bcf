"""The scenes are ordinary MJCF: plain MuJoCo loads them, and their stones are what they say."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from mjskip.hydro.stone import Stone

MODELS = Path(__file__).parent.parent / "models"
SCENES = ("lake", "duel", "clanet_disc")
STONES = {
    "lake": Stone.pebble(),
    "duel": Stone.pebble(),
    "clanet_disc": Stone.disc(0.025, 0.00275, density=2700.0),
}


def load(name):
    return mujoco.MjModel.from_xml_path(str(MODELS / f"{name}.xml"))


def free_bodies(model):
    return [
        int(model.jnt_bodyid[joint])
        for joint in range(model.njnt)
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
    ]


@pytest.mark.parametrize("name", SCENES)
def test_stones_have_the_mass_and_inertia_of_the_solid_mesh(name):
    model, stone = load(name), STONES[name]
    for body in free_bodies(model):
        # MuJoCo keeps mesh vertices in single precision: 6e-8 each, up to five of them multiplied
        assert model.body_mass[body] == pytest.approx(stone.mass, rel=1e-6)
        np.testing.assert_allclose(
            np.sort(model.body_inertia[body]), np.linalg.eigvalsh(stone.inertia), rtol=1e-6
        )
        np.testing.assert_allclose(model.body_ipos[body], 0.0, atol=1e-8)


@pytest.mark.parametrize("name", SCENES)
def test_the_axis_of_largest_inertia_is_the_body_z(name):
    model = load(name)
    for body in free_bodies(model):
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, model.body_iquat[body])
        largest = axes.reshape(3, 3)[:, int(np.argmax(model.body_inertia[body]))]
        assert abs(largest[2]) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("name", SCENES)
def test_stones_are_one_mesh_of_the_promised_triangles(name):
    model, stone = load(name), STONES[name]
    for body in free_bodies(model):
        assert model.body_geomnum[body] == 1
        geom = model.body_geomadr[body]
        assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
        assert model.mesh_facenum[model.geom_dataid[geom]] == len(stone.faces)


def test_the_pebble_has_44_triangles():
    model = load("lake")
    assert model.mesh_facenum.tolist() == [44]


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("camera", ["side", "top", "chase"])
def test_the_stone_is_not_a_speck(name, camera):
    model = load(name)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    index = model.camera(camera).id
    half_height = math.tan(0.5 * math.radians(model.cam_fovy[index]))
    body = free_bodies(model)[0]
    away = data.xpos[body] - data.cam_xpos[index]
    across, up, back = data.cam_xmat[index].reshape(3, 3).T @ away
    assert abs(across / back) < 0.8 * half_height * 640 / 480  # well inside the picture
    assert abs(up / back) < 0.8 * half_height
    diameter = 2.0 * STONES[name].radius / np.linalg.norm(away) / (2.0 * half_height) * 480
    # a twentieth of the picture's height; two stones side by side need a wider view
    assert diameter > (18 if name == "duel" else 24)


@pytest.mark.parametrize("name", SCENES)
def test_cameras_see_a_level_horizon(name):
    model = load(name)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for index in range(model.ncam):
        right = data.cam_xmat[index].reshape(3, 3)[:, 0]
        assert right[2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_states_its_water_and_its_throw(name):
    model = load(name)
    stated = {model.numeric(k).name for k in range(model.nnumeric)}
    water = ["density", "air_density", "shape", "spacing", "wave_speed", "damping", "centre"]
    throw = ["speed", "spin", "attack", "descent", "bank", "height"]
    assert {f"mjskip.{key}" for key in water + throw} <= stated
    assert {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, k) for k in range(model.ntext)} == {
        "mjskip.gate",
        "mjskip.stencil",
        "mjskip.boundary",
    }


def test_the_duel_differs_in_spin_only():
    model = load("duel")
    spinning, still = free_bodies(model)
    assert model.numeric(f"mjskip.spin.{model.body(still).name}").data[0] == 0.0
    assert model.numeric("mjskip.spin").data[0] > 0.0
    assert model.body_mass[spinning] == model.body_mass[still]
    assert model.body_pos[spinning][0] == model.body_pos[still][0]


@pytest.mark.parametrize("name", SCENES)
def test_a_throw_starts_inside_its_field(name):
    model = load(name)
    shape, spacing = model.numeric("mjskip.shape").data, model.numeric("mjskip.spacing").data[0]
    centre = model.numeric("mjskip.centre").data
    for body in free_bodies(model):
        assert (np.abs(model.body_pos[body][:2] - centre) < 0.5 * shape * spacing).all()
