"""What is too large for the memory, or for anybody's patience, is refused with its size before it begins."""

import re

import mujoco
import numpy as np
import pytest

import mjskip
from mjskip import HeightField, Limits, Stone, Throw
from mjskip import checks as checks_module
from mjskip.checks import check_memory, free_memory
from mjskip.coupling.moving_water import MovingWater
from mjskip.coupling.wet import HullOptions
from mjskip.draw.render import Shot
from mjskip.sweeps.batch import throw_all
from mjskip.waves.recording import SurfaceFrames

PEBBLE = Stone.pebble()
ANGLES = {"attack": (0.2, 0.4)}
MANY = np.linspace(1.0, 9.0, 4000)


def add_water(size):
    spec = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body name='b'><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    mjskip.add_water(spec, surface="deep", size=size)


TOO_LARGE = {
    "a sweep": (lambda: mjskip.sweep(PEBBLE, {"speed": MANY, "spin": MANY}), "has 16000000 throws: at most"),
    "steps of a sweep": (lambda: mjskip.sweep(PEBBLE, timestep=1e-12), r"makes 5e\+12 steps: at most 1e\+07"),
    "steps of many throws": (lambda: throw_all(PEBBLE, [Throw()], timestep=1e-12), r"5e\+12 steps: at most"),
    "steps of the integrator": (lambda: mjskip.integrate(PEBBLE, Throw(), timestep=1e-9), r"5e\+09 steps"),
    "steps of a yardstick": (
        lambda: mjskip.integrate(PEBBLE, Throw(), integrator="adaptive", timestep=1e-12), r"5e\+12 steps",
    ),
    "steps of a run": (lambda: mjskip.simulate("lake", limits=Limits(duration=1e5)), r"makes 2e\+08 steps"),
    "members": (lambda: mjskip.optimize(PEBBLE, ANGLES, members=10**6), r"the search has 504000000 throws"),
    "population": (lambda: mjskip.optimize(PEBBLE, ANGLES, population=10**6), r"672000000 throws"),
    "generations": (lambda: mjskip.optimize(PEBBLE, ANGLES, generations=10**5), "has 76800768 throws"),
    "threads": (lambda: throw_all(PEBBLE, [Throw()], threads=10**9), "threads is 1000000000: give a whole"),
    "a film": (lambda: Shot(linger=3600.0, fps=240.0, size=(1920, 1080)), r"864000 frames of 1920x1080, 1.79e\+12"),
    "a slow film": (
        lambda: SurfaceFrames(rate=2e5).check_duration(1e3, 1e-7), r"would be recorded 2e\+08 times: at most 1e\+06",
    ),
    "rings of a film": (lambda: SurfaceFrames(rate=1e6, linger=3600.0), r"recorded 3.6e\+09 times"),
    "a field": (lambda: HeightField((10**6, 10**6)), r"needs 8e\+03 GB and .* GB are free: use fewer cells"),
    "a field beyond numbers": (lambda: HeightField((10**300, 3)), "give two whole numbers from 3 to 1e"),
    "a window": (lambda: HeightField((8, 8)).window(0, 0, (10**6, 10**6)), r"needs 1.6e\+04 GB and"),
    "a load": (
        lambda: HeightField((8, 8)).press(0, 0, force=1.0, radius=1e4), r"a round load of 10000 m .* needs 3",
    ),
    "a bump": (
        lambda: HeightField.endless().displace(0, 0, height=0.01, radius=1e4), r"a round load of 10000 m",
    ),
    "a long time": (lambda: HeightField((8, 8)).advance(1e12), "steps of at most"),
    "water of a plugin": (lambda: MovingWater(surface="waves", size=1e6), "give 16 to 512 cells along a side"),
    "water of a model": (lambda: add_water(1e5), "give 16 to 512 cells along a side"),
    "a disc": (lambda: Stone.disc(0.05, 0.01, segments=10**8), "segments is 100000000: give a whole number"),
    "a lens": (lambda: Stone.lens(0.05, 0.01, rings=10**8), "rings is 100000000: give a whole number"),
    "a hull": (lambda: HullOptions(resolution=10**6), "resolution is 1000000: give a whole number"),
}  # fmt: skip


@pytest.mark.parametrize(("make", "says"), TOO_LARGE.values(), ids=TOO_LARGE)
def test_what_is_too_large_is_refused_at_once_with_its_size(make, says):
    with pytest.raises(ValueError) as refused:
        make()
    assert re.search(says, str(refused.value)), str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_record_that_does_not_fit_into_memory_is_refused_with_its_bytes(monkeypatch):
    monkeypatch.setattr(checks_module, "free_memory", lambda: 10**9)
    with pytest.raises(
        ValueError, match=r"a record of 5e\+06 steps of 1 bodies needs .* GB and 1 GB"
    ):
        mjskip.integrate(PEBBLE, Throw(), timestep=1e-6)


def test_memory_that_is_free_is_less_under_a_limit():
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_AS)
    with open("/proc/self/statm") as file:
        used = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 2**28, before[1]))
    try:
        assert 0 < free_memory() < 2**28 + 2**20
        with pytest.raises(
            ValueError, match=r"^a lake needs 0.3 GB and 0\.2.* GB are free: use less$"
        ):
            check_memory("a lake", 3e8, "use less")
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
    check_memory("a pond", 2**20, "use less")
