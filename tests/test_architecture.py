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
    {"errors", "laws", "attitude", "_jit", "_native"},
    {"water", "files"},
    {"stone", "trajectory"},
    {"throw"},
    {"_force_kernels", "_rigid_kernels"},
    {"forces"},
    {"recording", "waves"},
    {"reference", "coupling"},
    {"scene"},
    {"engines"},
    {"simulate"},
    {"comparison", "draw", "sweeps"},
    {"play"},
    {"cli"},
    {"__init__", "__main__"},
)
"""Lowest first; a file imports only from layers below its own. A file that is not listed stands just
above the highest that it imports, so that no listed file may import it from below."""

LISTED = {name: rank for rank, names in enumerate(LAYERS) for name in names}
READERS = {"coupling", "scene", "engines"}
"""Below `simulate`, the only readers of MuJoCo."""

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


def rank(unit, path=()):
    """Layer of a unit, listed or found."""
    assert unit not in path, f"imports go round: {' -> '.join([*path, unit])}"
    if unit in LISTED:
        return LISTED[unit]
    return 1 + max((rank(other, (*path, unit)) for other in family(unit)), default=-1)


@pytest.mark.parametrize("unit", sorted(UNITS))
def test_imports_point_down(unit):
    mine = rank(unit)
    wrong = {other: rank(other) for other in family(unit) if rank(other) >= mine}
    assert not wrong, f"{unit} (rank {mine}) imports {wrong}"


def test_every_listed_file_is_there():
    assert set(LISTED) <= UNITS, f"no such files: {sorted(set(LISTED) - UNITS)}"


PHYSICS = sorted(
    unit for unit, layer in LISTED.items() if layer < LISTED["simulate"] and unit not in READERS
)


@pytest.mark.parametrize("unit", PHYSICS)
def test_the_physics_never_imports_mujoco_not_even_through_others(unit):
    seen, todo = set(), {unit}
    while todo:
        member = todo.pop()
        seen.add(member)
        todo |= family(member) - seen
        modules = set().union(*(imported(n) for n in FILES if n.split(".")[0] == member))
        reads = any(module.split(".")[0] == "mujoco" for module in modules)
        assert not reads, f"{unit} imports mujoco through {member}"


def test_the_independent_witness_is_among_the_physics():
    witness = {"forces", "waves", "reference", "_force_kernels", "_rigid_kernels"}
    assert witness <= set(PHYSICS)


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
