"""From the full grid of the water to the vertices of the plain look."""

import mujoco
import numpy as np
import pytest

from mjskip.draw import _draw_kernels as kernels
from mjskip.draw.skin import Grid, WaterSkin, add_water
from mjskip.waves import HeightField


def boxes(axis):
    return np.column_stack([axis[:-1], axis[1:]])


def means(elevation, spacing, x_boxes, y_boxes, *, function=kernels.box_means):
    ny = elevation.shape[1]
    out = [np.empty((len(x_boxes), len(y_boxes))) for _ in range(3)]
    function(elevation, spacing, x_boxes, y_boxes, np.empty(ny), np.empty(ny), *out)
    return out


def rough(shape=(40, 30)):
    return np.random.default_rng(1).normal(0.0, 1.0, shape).astype(np.float32)


def test_boxes_that_tile_the_field_hold_its_volume():
    elevation = rough()
    x, y = np.array([-3.0, 2.7, 11.0, 11.5, 44.0]), np.array([-1.0, 8.25, 30.5])
    height, _, _ = means(elevation, 0.1, boxes(x), boxes(y))
    volume = (height * np.outer(np.diff(x), np.diff(y))).sum()
    assert volume == pytest.approx(elevation.sum(dtype=np.float64), rel=1e-12)


def test_a_tilted_plane_is_drawn_with_its_own_slope():
    x, y = np.arange(40) * 0.1, np.arange(30) * 0.1
    elevation = (0.3 * x[:, None] - 0.2 * y[None, :]).astype(np.float32)
    edges = np.array([3.0, 4.5, 9.0, 20.0])
    _, x_slope, y_slope = means(elevation, 0.1, boxes(edges), boxes(edges))
    # single-precision heights of order 1 over 0.2 m
    np.testing.assert_allclose(x_slope, 0.3, atol=2e-6)
    np.testing.assert_allclose(y_slope, -0.2, atol=2e-6)


def test_waves_finer_than_the_drawn_mesh_fade():
    chequered = np.where(np.indices((64, 64)).sum(axis=0) % 2, 1.0, -1.0).astype(np.float32)
    edges = np.arange(4.0, 60.0, 7.5)
    height, x_slope, y_slope = means(chequered, 1.0, boxes(edges), boxes(edges))
    # at most half a cell of each row and column is left over: (0.5 / 7.5)^2
    assert np.abs(height).max() <= 0.25 / 7.5**2 + 1e-12
    assert max(np.abs(x_slope).max(), np.abs(y_slope).max()) < 0.1


def test_outside_the_field_the_water_is_still():
    outside = np.array([[-9.0, -2.0], [40.0, 41.0], [70.0, 90.0]])
    for values in means(rough(), 0.1, outside, np.array([[3.0, 5.0]])):
        assert (values == 0.0).all()


def test_the_kernel_agrees_with_its_slow_twin():
    edges = boxes(np.array([-4.0, 0.3, 2.2, 7.9, 25.0, 33.0, 48.0]))
    fast = means(rough(), 0.1, edges, edges)
    slow = means(rough(), 0.1, edges, edges, function=kernels.box_means.py_func)
    for one, other in zip(fast, slow, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def test_normals_are_upright_on_still_water_and_lean_downhill():
    shape = (2, 1)
    slope = np.array([[0.0], [0.5]])
    vertices, normals = np.empty((2, 3), np.float32), np.empty((2, 3), np.float32)
    kernels.fill_skin(
        np.array([0.0, 1.0]),
        np.zeros(1),
        np.zeros(shape),
        slope,
        np.zeros(shape),
        vertices,
        normals,
    )
    np.testing.assert_array_equal(normals[0], [0.0, 0.0, 1.0])
    # single precision
    np.testing.assert_allclose(normals[1], np.array([-0.5, 0.0, 1.0]) / np.sqrt(1.25), rtol=1e-6)


def test_the_grid_is_even_near_the_stone_and_reaches_the_horizon():
    grid = Grid.around(step=0.02)
    steps = np.diff(grid.x)
    middle = len(steps) // 2
    np.testing.assert_allclose(steps[middle - 10 : middle + 10], 0.02, rtol=1e-9)
    assert (steps > 0.0).all()
    assert steps[middle:] == pytest.approx(np.sort(steps[middle:]), rel=1e-9)
    assert grid.x[-1] == -grid.x[0] > 200.0
    assert len(grid.x) * len(grid.y) <= 125 * 125


@pytest.mark.parametrize("shape", [(124, 125), (11, 125), (401, 41)])
def test_a_grid_that_cannot_be_drawn_is_refused(shape):
    with pytest.raises(ValueError, match="two odd numbers"):
        Grid.around(step=0.02, shape=shape)


def test_vertices_near_the_stone_stay_in_their_places_as_the_grid_follows():
    grid = Grid.around(step=0.02)
    spec = mujoco.MjSpec()
    add_water(spec, grid)
    model = spec.compile()
    scene = mujoco.MjvScene(model, maxgeom=10)
    scene.skinvert[:] = 0.0
    skin = WaterSkin(model, grid)
    water = HeightField((50, 50), 0.02)
    places = []
    for focus in ((0.1, 0.0), (0.153, -0.031)):
        mujoco.mjv_updateScene(
            model,
            mujoco.MjData(model),
            mujoco.MjvOption(),
            mujoco.MjvPerturb(),
            mujoco.MjvCamera(),
            mujoco.mjtCatBit.mjCAT_ALL,
            scene,
        )
        skin.draw(scene, water, focus=focus)
        x = scene.skinvert.reshape(-1, 3)[:, 0]
        places.append(np.unique(np.round(x[np.abs(x - focus[0]) < 0.1], 5)))
    common = np.intersect1d(*places)
    assert len(common) >= 6  # vertices 0.02 m apart, in the 0.147 m that both show
    # single-precision coordinates
    np.testing.assert_allclose(common / 0.02, np.round(common / 0.02), atol=1e-3)


def test_a_bump_is_drawn_where_it_is():
    grid = Grid.around(step=0.02)
    spec = mujoco.MjSpec()
    add_water(spec, grid)
    model = spec.compile()
    scene = mujoco.MjvScene(model, maxgeom=10)
    mujoco.mjv_updateScene(
        model,
        mujoco.MjData(model),
        mujoco.MjvOption(),
        mujoco.MjvPerturb(),
        mujoco.MjvCamera(),
        mujoco.mjtCatBit.mjCAT_ALL,
        scene,
    )
    water = HeightField((80, 60), 0.02, centre=(2.0, -1.0))
    water.displace(2.2, -1.3, height=0.05, radius=0.06)
    WaterSkin(model, grid).draw(scene, water, focus=(2.1, -1.2))
    vertices = scene.skinvert.reshape(-1, 3)
    raised = vertices[vertices[:, 2] > 0.6 * vertices[:, 2].max()]
    # half a drawn step
    np.testing.assert_allclose(raised[:, :2].mean(axis=0), [2.2, -1.3], atol=0.01)
    assert 0.03 < vertices[:, 2].max() < 0.05  # averaging over a vertex's box lowers a crest
