"""Imports point one way, the physics knows no MuJoCo, and importing does nothing else."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import mjskip

PACKAGE = Path(mjskip.__file__).parent

LAYERS = (
    {"_typing", "errors"},
    {"checks"},
    {"_compile", "files"},
    {"rigid"},
    {"hydro"},
    {"waves"},
    {"coupling"},
    {"throws"},
    {"draw", "sweeps"},
    {"play", "envs"},
    {"cli"},
    {"__init__", "__main__"},
)
"""Lowest first; a file imports only from layers below its own."""

LISTED = {name: rank for rank, names in enumerate(LAYERS) for name in names}

PATHS = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts): path
    for path in sorted(PACKAGE.rglob("*.py"))
}
FILES = list(PATHS)
UNITS = {name.split(".")[0] for name in FILES}
"""A folder of the package counts as one unit."""


def imported(name):
    """Modules that a file imports anywhere in it, also under TYPE_CHECKING and in functions."""
    found = set()
    for node in ast.walk(ast.parse(PATHS[name].read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}.py has a relative import: write it in full"
            found.add(node.module)
            if node.module == "mjskip":
                found |= {f"mjskip.{alias.name}" for alias in node.names}
    return found


def family(unit):
    """Units of this package, other than itself, that the files of a unit import."""
    modules = set().union(*(imported(name) for name in FILES if name.split(".")[0] == unit))
    named = {module.split(".")[1] for module in modules if module.startswith("mjskip.")}
    return (named & UNITS) - {unit}


@pytest.mark.parametrize("unit", sorted(UNITS))
def test_imports_point_down(unit):
    assert unit in LISTED, f"{unit} has no layer: list it in LAYERS"
    wrong = {other for other in family(unit) if LISTED[other] >= LISTED[unit]}
    assert not wrong, f"{unit} imports {wrong}, which are not below it"


def test_every_listed_package_is_there():
    assert set(LISTED) <= UNITS, f"no such packages: {sorted(set(LISTED) - UNITS)}"


WITNESS = ("hydro", "rigid", "waves", "throws.reference")
"""The physics and the pure integrator: they never import MuJoCo."""


@pytest.mark.parametrize("root", WITNESS)
def test_the_independent_witness_never_imports_mujoco_not_even_through_others(root):
    seen, waiting = set(), {name for name in FILES if name == root or name.startswith(root + ".")}
    assert waiting
    while waiting:
        name = waiting.pop()
        seen.add(name)
        modules = imported(name)
        assert not any(m.split(".")[0] == "mujoco" for m in modules), f"{root} reads it by {name}"
        inner = {m.removeprefix("mjskip.") for m in modules if m.startswith("mjskip.")}
        waiting |= (inner & set(FILES)) - seen


LOOK = """
import json, sys
compiled = []
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
def watched(compile):
    return lambda self, *args: (compiled.append(str(self)), compile(self, *args))[1]
Dispatcher.compile, CFunc.compile = watched(Dispatcher.compile), watched(CFunc.compile)
import ctypes, os
import mujoco
from pathlib import Path
library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
slots = ["mjcb_control", "mjcb_passive", "mjcb_sensor", "mjcb_contactfilter", "mjcb_time",
         "mjcb_act_dyn", "mjcb_act_gain", "mjcb_act_bias"]
def installed():
    return [s for s in slots if ctypes.c_void_p.in_dll(library, s).value]
def drawing():
    return [m for m in sys.modules if m.startswith(("OpenGL", "glfw", "mujoco.egl", "mujoco.glfw"))]
before = installed() + drawing()  # what the bindings bring themselves: a clock, glfw
import mjskip
print(json.dumps({
    "compiled": compiled,
    "callbacks": [s for s in installed() if s not in before],
    "gl": [m for m in drawing() if m not in before],
    "backend": os.environ.get("MUJOCO_GL"),
    "plots": [m for m in ("matplotlib.pyplot", "tkinter", "IPython") if m in sys.modules],
    "threads": __import__("threading").active_count(),
}))
"""


def test_importing_compiles_nothing_opens_no_gl_and_installs_no_callback(tmp_path):
    home = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-W", "error", "-c", LOOK]
    run = subprocess.run(
        command, cwd=tmp_path, env=home, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    seen = json.loads(run.stdout)
    assert seen["compiled"] == []
    assert seen["callbacks"] == []
    assert seen["gl"] == []
    assert seen["backend"] is None
    assert seen["threads"] == 1
    assert not list(tmp_path.iterdir())


def test_the_names_that_others_rely_on():
    for name in (
        "Water", "Stone", "Throw", "HeightField", "Trajectory", "Contact", "wrench", "integrate",
        "simulate", "attach", "load_scene", "render_video", "__version__",
    ):  # fmt: skip
        assert hasattr(mjskip, name)
