"""The public names: loaded on first use, typed for a user's checker, and shadowing no module."""

import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import mjskip

PACKAGE = Path(mjskip.__file__).parent
MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(mjskip.__path__, "mjskip.", onerror=lambda _: None)
    if module.name != "mjskip.__main__"
)
HEAVY = (
    "mujoco",
    "numba",
    "numpy",
    "scipy",
    "trimesh",
    "shapely",
    "xarray",
    "pandas",
    "matplotlib",
)


def in_a_new_process(code):
    """What a Python that has just started prints."""
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(PACKAGE.parent)},
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_every_public_name_is_there_and_listed():
    for name in mjskip.__all__:
        assert getattr(mjskip, name) is not None
        assert name in dir(mjskip)
    assert mjskip.__version__
    with pytest.raises(AttributeError, match=r"no attribute 'throw_stone': it has .*simulate"):
        _ = mjskip.throw_stone


def test_importing_loads_nothing_heavy():
    loaded = in_a_new_process("import mjskip, sys; print(*sys.modules)").split()
    assert not set(HEAVY) & set(loaded)


def test_help_loads_nothing_heavy():
    asked = "import sys, mjskip.cli\ntry: mjskip.cli.main(['--help'])\nexcept SystemExit: pass\n"
    loaded = in_a_new_process(asked + "print(*sys.modules)").splitlines()[-1].split()
    assert not set(HEAVY) & set(loaded)


def test_a_body_in_water_needs_no_tables_and_no_drawing():
    loaded = in_a_new_process("import sys; from mjskip import attach; print(*sys.modules)").split()
    assert not {"xarray", "pandas", "matplotlib", "mediapy", "rich"} & set(loaded)
    slow = (
        "scipy.special",
        "scipy.spatial",
        "scipy.sparse",
        "scipy.interpolate",
        "scipy.fft",
        "trimesh",
    )
    assert not {*slow, "rocket_fft", "manifold3d", "shapely"} & set(loaded)
    assert not [name for name in loaded if name.startswith(("mjskip.draw", "mjskip.sweeps"))]


@pytest.mark.parametrize("name", MODULES)
def test_no_function_takes_the_place_of_a_module(name):
    try:
        module = importlib.import_module(name)
    except ImportError as error:  # of an optional package
        pytest.skip(str(error))
    for public in mjskip.__all__:
        getattr(mjskip, public)
    found = mjskip
    for part in name.split(".")[1:]:
        found = getattr(found, part)
    assert isinstance(found, ModuleType)
    assert found is module


USER = '''
"""A user's file: everything that is public, with the types it has."""

from collections.abc import Mapping

import mujoco
import numpy as np
import numpy.typing as npt

import mjskip
from mjskip import errors

stone: mjskip.Stone = mjskip.Stone.pebble()
water = mjskip.Water(law="lee2010", gate="local")
throw: mjskip.Throw = mjskip.Throw.from_degrees(speed=12.0)
scene: mjskip.Scene = mjskip.load_scene("lake")
limits = mjskip.Limits(duration=1.0)
run: mjskip.Trajectory = mjskip.simulate(scene, throw, engine="mujoco", limits=limits)
all_runs: Mapping[str, mjskip.Trajectory] = mjskip.simulate_all(scene)
witness: mjskip.Trajectory = mjskip.integrate(stone, throw, water=water)
touch: mjskip.Contact = witness.contacts[0]
force: npt.NDArray[np.float64] = mjskip.wrench(stone, water, position=(0.0, 0.0, 0.0)).force
'''


def test_a_users_type_checker_knows_the_type_of_every_public_name(tmp_path):
    pytest.importorskip("mypy")
    assert (PACKAGE / "py.typed").is_file()
    file = tmp_path / "user.py"
    revealed = "".join(f"reveal_type(mjskip.{name})\n" for name in mjskip.__all__)
    file.write_text(USER + revealed)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent",
               "--config-file", str(PACKAGE.parent / "pyproject.toml"), str(file)]  # fmt: skip
    run = subprocess.run(
        command, cwd=PACKAGE.parent, capture_output=True, text=True, check=False, timeout=600
    )
    assert run.returncode == 0, run.stdout
    notes = [line for line in run.stdout.splitlines() if "Revealed type is" in line]
    assert len(notes) == len(mjskip.__all__)
    assert not [note for note in notes if note.endswith('is "Any"')]
