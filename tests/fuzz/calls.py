"""Every public callable with arguments that fit: what a case of the kind "call" puts an unfit one in the place of."""

import inspect
from functools import cache

import mujoco
import numpy as np

import mjskip

RAFT = """
<mujoco>
  <option timestep="0.002"/>
  <visual><global offwidth="64" offheight="48"/></visual>
  <worldbody>
    <body name="raft" pos="0 0 0.1">
      <freejoint/>
      <geom name="deck" type="box" size="0.1 0.1 0.05" density="500"/>
    </body>
  </worldbody>
</mujoco>
"""
SHORT = mjskip.Limits(duration=0.02)


@cache
def _raft():
    model = mujoco.MjModel.from_xml_string(RAFT)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@cache
def _moving():
    spec = mujoco.MjSpec.from_string(RAFT)
    mjskip.add_water(spec, mjskip.Water.floating(), surface="waves")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    return model, data


@cache
def _coupling():
    return mjskip.Coupling(*_raft(), mjskip.Water.floating())


@cache
def _sea():
    return mjskip.Sea.regular(height=0.1, period=2.0)


@cache
def _run():
    return mjskip.integrate(mjskip.Stone.pebble(), mjskip.Throw(), limits=SHORT)


def _small():
    return mjskip.HeightField((8, 8))


def _calls():
    stone, throw = mjskip.Stone.pebble(), mjskip.Throw()
    solid = {"vertices": stone.vertices, "faces": stone.faces, "inertia": stone.inertia}
    place = {"x": 0.0, "y": 0.0, "radius": 0.05}
    quick = {"limits": SHORT}
    model, data = _raft()
    return {
        "HeightField": (mjskip.HeightField, {"shape": (8, 8)}),
        "HeightField.endless": (mjskip.HeightField.endless, {}),
        "HeightField.sample": (_anew(_small, "sample"), {"x": 0.0, "y": 0.0}),
        "HeightField.window": (_anew(_small, "window"), {"x": 0.0, "y": 0.0, "shape": (4, 4)}),
        "HeightField.press": (_anew(_small, "press"), {**place, "force": 1.0}),
        "HeightField.displace": (_anew(_small, "displace"), {**place, "height": 0.01}),
        "HeightField.set": (_anew(_small, "set"), {"elevation": 0.0}),
        "HeightField.step": (_anew(_small, "step"), {"timestep": 1e-3}),
        "HeightField.advance": (_anew(_small, "advance"), {"duration": 0.01}),
        "HeightField.save": (_anew(_small, "save"), {"path": "field.npz"}),
        "HeightField.load": (mjskip.HeightField.load, {"path": "missing.npz"}),
        "Hull.of_surface": (mjskip.Hull.of_surface, solid),
        "Limits": (mjskip.Limits, {}),
        "Limits.rules": (SHORT.rules, {}),
        "Scene.water_of": (mjskip.load_scene("lake").water_of, {"body": "stone"}),
        "Scene.rethrow": (lambda speed=3.0, attack=0.3: mjskip.load_scene("lake").rethrow(speed=speed, attack=attack), {}),
        "Sea.regular": (mjskip.Sea.regular, {"height": 0.1, "period": 2.0}),
        "Sea.irregular": (mjskip.Sea.irregular, {"hs": 0.1, "tp": 2.0, "components": 8}),
        "Sea.from_text": (mjskip.Sea.from_text, {"text": "height=0.1 period=2"}),
        "Sea.elevation": (_sea().elevation, {"points": np.zeros((2, 2)), "time": 0.0}),
        "Sea.velocity": (_sea().velocity, {"points": np.zeros((2, 3)), "time": 0.0}),
        "Sea.pressure": (_sea().pressure, {"points": np.zeros((2, 3)), "time": 0.0}),
        "Stone.pebble": (mjskip.Stone.pebble, {}),
        "Stone.disc": (mjskip.Stone.disc, {"radius": 0.05, "thickness": 0.01}),
        "Stone.lens": (mjskip.Stone.lens, {"radius": 0.05, "thickness": 0.01}),
        "Stone.from_mesh": (mjskip.Stone.from_mesh, {"mesh": (stone.vertices, stone.faces), "density": 2700.0}),
        "Throw": (mjskip.Throw, {}),
        "Throw.from_degrees": (mjskip.Throw.from_degrees, {}),
        "Throw.state": (throw.state, {"stone": stone}),
        "Trajectory.save": (_run().save, {"path": "run.nc"}),
        "Trajectory.load": (mjskip.Trajectory.load, {"path": "missing.nc"}),
        "Water": (mjskip.Water, {}),
        "Water.floating": (mjskip.Water.floating, {}),
        "WaterAppearance": (mjskip.WaterAppearance, {}),
        "wrench": (mjskip.wrench, {"stone": stone, "position": np.zeros(3)}),
        "integrate": (mjskip.integrate, {"stone": stone, "throw": throw, **quick}),
        "simulate": (mjskip.simulate, quick),
        "simulate_all": (mjskip.simulate_all, quick),
        "load_scene": (mjskip.load_scene, {}),
        "sweep": (mjskip.sweep, {"scene": stone, "vary": {"speed": [3.0]}, **quick}),
        "optimize": (
            mjskip.optimize,
            {"stone": stone, "ranges": {"attack": (0.2, 0.4)}, "members": 1, "population": 4, "generations": 1, **quick},
        ),
        "attach": (_closed(mjskip.attach), {"model": model, "data": data}),
        "float_at_rest": (mjskip.float_at_rest, {"model": model, "data": mujoco.MjData(model)}),
        "add_water": (mjskip.add_water, {"spec": mujoco.MjSpec.from_string(RAFT)}),
        "Coupling.wrench": (_coupling().wrench, {"data": data, "body": "raft"}),
        "Coupling.wrenches": (_coupling().wrenches, {"data": data}),
        "Coupling.tree_wrench": (_coupling().tree_wrench, {"data": data}),
        "Coupling.hydrostatics": (_coupling().hydrostatics, {"data": data}),
        "Coupling.triangles": (_coupling().triangles, {"data": data}),
        "Coupling.report": (_coupling().report, {"data": data}),
        "Coupling.elevation": (_coupling().elevation, {"data": data, "points": np.zeros((2, 2))}),
        "Coupling.centre": (_coupling().centre, {"data": data, "k": 0}),
        "Coupling.state": (_coupling().state, {"data": data, "k": 0}),
        "WaterSurface": (mjskip.WaterSurface, dict(zip(("model", "data"), _moving(), strict=True))),
        "WaterSurface.elevation": (mjskip.WaterSurface(*_moving()).elevation, {"x": 0.0, "y": 0.0}),
        "WaterSurface.press": (mjskip.WaterSurface(*_moving()).press, {"x": 0.0, "y": 0.0, "impulse": 1e-3}),
        "Renderer": (_closed(mjskip.Renderer), {"model": model, "height": 24, "width": 32}),
        "render_video": (mjskip.render_video, {"scene": mjskip.load_scene("lake"), "trajectory": _run(), "path": "no/film.mp4"}),
    }  # fmt: skip


def _anew(make, method):
    """A method of a new object at every call."""

    def call(*arguments, **named):
        return getattr(make(), method)(*arguments, **named)

    call.__signature__ = inspect.signature(getattr(make(), method))
    return call


def _closed(make):
    """What makes something that is to be closed, closing it."""

    def call(*arguments, **named):
        make(*arguments, **named).close()

    call.__signature__ = inspect.signature(make)
    return call


@cache
def calls():
    """By name: the callable, arguments that fit, and the names of all its arguments."""
    found = {}
    for name, (function, fit) in _calls().items():
        parameters = tuple(p for p in inspect.signature(function).parameters if p != "progress")
        found[name] = function, fit, parameters
    return found
