"""Land: where fixed geoms pierce the surface; and the end of the lake."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from mjskip import HeightField, Limits, load_scene, simulate
from mjskip.coupling.terrain import ModelTerrain
from mjskip.errors import MjskipWarning, SceneError
from mjskip.throws.engines import ReferenceEngine
from mjskip.throws.run import Run

WORLD = """<mujoco>
  <custom><numeric name="mjskip.obstacles" data="{on}"/>
    <numeric name="mjskip.shape" data="200 150"/><numeric name="mjskip.spacing" data=".02"/></custom>
  <worldbody>
    <geom name="bottom" type="plane" pos="0 0 -1" size="0 0 1"/>
    <geom name="pier" type="box" pos="-1 0 0" euler="0 0 30" size=".5 .1 .3"/>
    <geom name="sunken" type="box" pos="1 1 -.5" size=".2 .2 .3"/>
    <geom name="lamp" type="sphere" pos="1 -1 .5" size=".3"/>
    <body pos=".8 0 -.3"><geom name="island" type="sphere" size=".5"/></body>
    <body name="stone" pos="0 .8 0"><freejoint/>
      <geom type="box" size=".05 .05 .02" density="2000"/></body>
  </worldbody>
</mujoco>"""


@pytest.fixture
def world(tmp_path):
    def write(on=1):
        path = tmp_path / "world.xml"
        path.write_text(WORLD.format(on=on))
        return load_scene(path)

    return write


def test_land_is_where_fixed_geoms_pierce_the_surface_and_nowhere_else(world):
    field = world().field()
    x, y = np.meshgrid(field.x, field.y, indexing="ij")
    # the ball of 0.5 m whose centre is 0.3 m deep cuts the surface in a disc of 0.4 m
    distance = np.hypot(x - 0.8, y)
    turn = math.radians(30.0)
    along = (x + 1.0) * math.cos(turn) + y * math.sin(turn)
    across = -(x + 1.0) * math.sin(turn) + y * math.cos(turn)
    pier = (abs(along) < 0.5) & (abs(across) < 0.1)
    # the ball is a polyhedron, whose section lies within a centimetre of the round one
    sure = abs(distance - 0.4) > 0.01
    np.testing.assert_array_equal(field.terrain_mask[sure], (pier | (distance < 0.4))[sure])
    assert pier.any()


def test_waves_do_not_enter_an_island_and_lose_no_water_to_it(world):
    scene = world()
    field = HeightField(**scene.grid, terrain_mask=ModelTerrain(scene.model))  # nothing sleeps
    field.press(0.0, 0.0, force=20.0, radius=0.1)
    field.advance(0.05)
    field.advance(1.5)
    assert not field.elevation[field.terrain_mask].any()
    assert abs(field.elevation).max() > 1e-3
    moved = float(abs(field.elevation).sum()) * field.spacing**2
    assert abs(field.volume()) < 1e-4 * moved  # single precision


def test_obstacles_are_off_unless_asked_for(world):
    assert world(0).field().terrain_mask is None
    assert load_scene("lake").field().terrain_mask is None


def test_what_a_switch_cannot_be_is_refused(world):
    with pytest.raises(SceneError, match="obstacles is 2: give 1"):
        world(2)


def test_a_stone_throws_waves_at_an_island_that_it_feels(world):
    scene = world().rethrow(speed=4.0, height=0.0)
    mask = ModelTerrain(scene.model)
    field = HeightField((256, 128), terrain_mask=mask, sleep_amplitude=1e-30)
    with ReferenceEngine(scene, None, 5e-4, frozen_attitude=False, over_waves=True) as engine:
        run = Run(scene, engine, 5e-4, field=field, feel=True)
        run.advance(2000)
        run.show()
    level, land = field.elevation, mask(field.x, field.y)
    assert land.any()
    assert not level[land].any()
    # waves have come to the island's shore, not only near the stone, and lost no water to it
    shore = land ^ (land | np.roll(land, 1, 1) | np.roll(land, -1, 1))
    assert abs(level[shore]).max() > 1e-4
    moved = float(abs(level).sum()) * 0.02**2
    assert abs(field.volume()) < 1e-4 * moved


@pytest.mark.parametrize("sleep_amplitude", [0.0, 1e-30])
def test_a_load_on_the_shore_moves_water_and_makes_none(sleep_amplitude):
    field = HeightField((128, 128), terrain_mask=islands, sleep_amplitude=sleep_amplitude)
    for x, y in ((0.2, 0.1), (1.0, -1.2)):  # by the disc; by the pier, at the wall
        field.press(x, y, force=5.0, radius=0.1)
    field.step(0.01)
    assert abs(field.elevation).max() > 1e-3
    assert not field.elevation[field.terrain_mask].any()
    assert abs(field.volume()) < 1e-9


def islands(x, y):
    """A disc across tiles, a pier at a wall, and a rock of one cell."""
    x, y = np.asarray(x)[:, None], np.asarray(y)[None, :]
    disc, pier = np.hypot(x + 0.1, y - 0.2) < 0.35, (abs(x - 0.9) < 0.1) & (y < -0.8)
    return disc | pier | ((abs(x - 0.61) < 0.01) & (abs(y - 0.61) < 0.01))


def test_land_that_covers_everything_is_refused():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="box" size="9 9 1"/></worldbody></mujoco>'
    )
    with pytest.raises(ValueError, match="leave some water"):
        HeightField((20, 20), terrain_mask=ModelTerrain(model))


def test_a_stone_that_flies_over_the_wall_of_its_lake_has_left_it(lake):
    grid = {**lake.grid, "shape": (128, 128), "boundary": "reflect", "centre": (-3.5, 0.0)}
    small = replace(lake, grid=grid)
    run = simulate(small, surface="waves", limits=Limits(duration=2.0))
    assert run.end == "left the lake"
    assert run.position[-1, 0] > -3.5 + 64 * 0.02
    assert run.position[-2, 0] <= -3.5 + 64 * 0.02
    # still water has no end
    assert simulate(small, limits=Limits(duration=2.0)).end != "left the lake"


def test_the_pure_integrator_says_that_it_passes_through_land(world):
    scene = replace(world(), grid={"shape": (256, 128), "spacing": 0.02})
    with pytest.warns(MjskipWarning, match="knows no contacts: its stones pass through land"):
        simulate(
            scene, engine="reference", surface="waves", timestep=5e-4, limits=Limits(duration=0.01)
        )
