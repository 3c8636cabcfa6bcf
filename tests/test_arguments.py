"""A wrong type for a public argument is one line: its name, what came, what to give."""

import re

import numpy as np
import pytest

import mjskip
from mjskip import Limits, Stone, Throw, Water
from mjskip.sweeps.batch import throw_all
from mjskip.sweeps.design import Design, latin_hypercube, normal, span

PEBBLE = Stone.pebble()
BOX = {"attack": (0.2, 0.4)}
DATED = {"throw": {"speed": 3}, "water": {"density": 1000}, "limits": {"duration": 1}}

WRONG = {
    # a throw, a fluid, limits
    "text for a speed": (lambda: Throw(speed="fast"), "speed is 'fast': give a number between 0 and"),
    "a switch for a speed": (lambda: Throw(speed=True), "speed is True: give a number"),
    "nothing for a spin": (lambda: Throw.from_degrees(spin=None), "spin is None: give a number"),
    "an array for a height": (lambda: Throw(height=np.ones(2)), "height is .*: give a number"),
    "a word for a switch": (lambda: Water(buoyancy="no"), "buoyancy is 'no': give True or False"),
    "text for a density": (lambda: Water(density="1000"), "density is '1000': give a finite number"),
    "a list for a law": (lambda: Water(law=["lee2010"]), r"law is \['lee2010'\]: use one of lee2010"),
    "a list for a gate": (lambda: Water(gate=None), "gate is None: use one of centre, local"),
    "text for a duration": (lambda: Limits(duration="5"), "duration is '5': give a finite number"),
    "text for a rest speed": (lambda: Limits(rest_speed="slow"), "rest_speed is 'slow': give"),
    # scenes
    "nothing for a scene": (lambda: mjskip.load_scene(None), "scene is None: give a path"),
    "a number for a scene": (lambda: mjskip.load_scene(3), "scene is 3: give a path"),
    "a number for a body": (lambda: mjskip.load_scene("lake", body=0), "body is 0: give the name"),
    # a run
    "a dict to throw": (lambda: mjskip.simulate("lake", {"speed": 3}), r"throw is \{.*: give a mjskip\.T"),
    "a dict of limits": (
        lambda: mjskip.simulate("lake", limits={"duration": 1}), r"limits is \{.*: give a mjskip\.Limits",
    ),
    "nothing to throw in": (lambda: mjskip.simulate(None), "scene is None: give a path"),
    "no such engine": (lambda: mjskip.simulate("lake", engine=1), "engine is 1: use one of mujoco, ref"),
    "no such surface": (lambda: mjskip.simulate_all("lake", surface="wet"), "surface is 'wet': use one"),
    "deep water under a throw": (lambda: mjskip.simulate("lake", surface="deep"), "surface is 'deep': a throw keeps"),
    "text for a run's step": (lambda: mjskip.simulate("lake", timestep="1"), "timestep is '1': give a f"),
    "a word for frozen": (
        lambda: mjskip.simulate("lake", frozen_attitude="no"), "frozen_attitude is 'no': give True or",
    ),
    # the pure integrator
    "a path for a stone": (lambda: mjskip.integrate("a.stl", Throw()), r"stone is 'a\.stl': give a mj"),
    "a dict for a throw": (lambda: mjskip.integrate(PEBBLE, {}), r"throw is \{\}: give a mjskip\.Throw"),
    **{
        f"a dict for {name}": (
            lambda name=name, value=value: mjskip.integrate(PEBBLE, Throw(), **{name: value}),
            rf"{name} is \{{.*: give a mjskip\.{name.capitalize()}$",
        )
        for name, value in DATED.items()
        if name != "throw"
    },
    "a number for gravity": (
        lambda: mjskip.integrate(PEBBLE, Throw(), gravity=9.81), "gravity is 9.81: give 3 finite numbers",
    ),
    "text for a time step": (
        lambda: mjskip.integrate(PEBBLE, Throw(), timestep="1e-3"), "timestep is '1e-3': give a finite",
    ),
    "no such integrator": (
        lambda: mjskip.integrate(PEBBLE, Throw(), integrator="rk5"), "integrator is 'rk5': use one of eu",
    ),
    # many throws
    "a throw alone": (lambda: throw_all(PEBBLE, Throw()), "throws is Throw.*: give a row of throws"),
    "throws of dicts": (lambda: throw_all(PEBBLE, [{}]), r"throw is \{\}: give a mjskip\.Throw"),
    "a dict for a fluid": (lambda: throw_all(PEBBLE, [Throw()], water={}), r"water is \{\}: give a"),
    "half a thread": (lambda: throw_all(PEBBLE, [Throw()], threads=0.5), "threads is 0.5: give a whole"),
    **{
        f"a dict for {name} of a sweep": (
            lambda name=name, value=value: mjskip.sweep(PEBBLE, {"speed": [5.0]}, **{name: value}),
            rf"{name} is \{{.*: give a mjskip\.{name.capitalize()}$",
        )
        for name, value in DATED.items()
    },
    "a list to vary": (lambda: mjskip.sweep(PEBBLE, ["speed"]), r"axes is \['speed'\]: give values by"),
    "a number to vary": (lambda: mjskip.sweep(PEBBLE, {"speed": 5.0}), "speed has values of shape"),
    "words to vary": (lambda: mjskip.sweep(PEBBLE, {"speed": ["fast"]}), r"speed is \['fast'\]: give a r"),
    "no such law": (lambda: mjskip.sweep(PEBBLE, {"law": ["foo"]}), "law is 'foo': use one of lee2010"),
    "no such switch": (lambda: mjskip.sweep(PEBBLE, {"buoyancy": "no"}), "buoyancy is 'no': use one of"),
    "a number for a store": (lambda: mjskip.sweep(PEBBLE, path=3), "path is 3: give a path"),
    "text for a chunk": (lambda: mjskip.sweep(PEBBLE, chunk="8"), "chunk is '8': give a whole number"),
    "a number for a scheduler": (lambda: mjskip.sweep(PEBBLE, scheduler=8786), "scheduler is 8786: give"),
    "too many throws": (
        lambda: Design(axes={n: np.arange(4000.0) for n in ("speed", "mass")}), "16000000 throws",
    ),
    "too long a range": (lambda: span(0, 1, 10**9), "is 1000000000: give a whole number between 1 and"),
    "one end of a range": (lambda: latin_hypercube({"speed": 5}, count=4, seed=0), "speed is 5: give two"),
    "no count": (lambda: normal({"speed": (0, 1)}, count=0, seed=0), "count is 0: give a whole number"),
    # the best throw
    "a list of ranges": (lambda: mjskip.optimize(PEBBLE, ["attack"]), r"ranges is \['attack'\]: give"),
    "no ranges": (lambda: mjskip.optimize(PEBBLE, {}), r"ranges is \{\}: say what"),
    "one end": (lambda: mjskip.optimize(PEBBLE, {"attack": 0.3}), "attack is 0.3: give 2 finite numbers"),
    "a list of scatter": (
        lambda: mjskip.optimize(PEBBLE, BOX, scatter=[0.1]), r"scatter is \[0\.1\]: give standard",
    ),
    "a dict for the best throw": (lambda: mjskip.optimize(PEBBLE, BOX, throw={}), r"throw is \{\}: give a"),
    "half a member": (lambda: mjskip.optimize(PEBBLE, BOX, members=0.5), "members is 0.5: give a whole"),
}  # fmt: skip


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_a_wrong_argument_is_one_line_that_names_it(call, says):
    with pytest.raises(ValueError) as refused:
        call()
    text = str(refused.value)
    assert re.search(
        f"(^|a parameter of |the number of values of a range |the sweep has ){says}", text
    ), text
    assert "\n" not in text
    assert len(text) < 250


def test_what_is_shown_of_an_object_fits_a_line():
    scene = mjskip.load_scene("lake")
    run = mjskip.integrate(PEBBLE, Throw(), limits=Limits(duration=0.3))
    batch = throw_all(PEBBLE, [Throw()] * 50, limits=Limits(duration=0.1))
    for thing in (scene, run, batch, PEBBLE, Throw(), Water(), Limits()):
        assert len(repr(thing)) < 200
        assert "\n" not in repr(thing)
