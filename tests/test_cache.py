"""Compiled code is never stale, and a damaged or unwritable cache costs time and at most one line."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import mjskip
from mjskip._compile import cache

PACKAGE = Path(mjskip.__file__).parent

PROGRAM = """
import ctypes

import numpy as np
from numba import types

from mjskip._compile.jit import kernel, native
from mjskip._compile.pointers import F8P
from mjskip.rigid._rigid_kernels import rotation


@kernel
def turned(out):
    rotation(0.5, 0.5, 0.5, 0.1, out)


@native(types.void(F8P))
def turned_in_c(out):
    rotation(0.5, 0.5, 0.5, 0.2, out)


states = np.zeros((2, 18))
turned(states[0])
turned_in_c.ctypes(states[1].ctypes.data_as(ctypes.POINTER(ctypes.c_double)))
print(states.tobytes().hex())
"""


@pytest.fixture
def copied(tmp_path):
    """A copy of the package, with a program that compiles a kernel and a C function with it."""
    ignored = shutil.ignore_patterns("__pycache__")
    for part in ("_compile", "rigid"):
        shutil.copytree(PACKAGE / part, tmp_path / "mjskip" / part, ignore=ignored)
    for file in PACKAGE.glob("*.py"):
        shutil.copy(file, tmp_path / "mjskip")
    (tmp_path / "program.py").write_text(PROGRAM)
    return tmp_path


def run(folder):
    """What the program prints in a new process, and how often it warns."""
    env = {"PATH": os.environ["PATH"], "HOME": str(folder), "XDG_CACHE_HOME": str(folder / "user")}
    done = subprocess.run(
        [sys.executable, "program.py"], cwd=folder, env=env, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout, done.stderr.count("MjskipWarning")


def cached(folder, suffix):
    """Files of the cache."""
    found = sorted(folder.rglob(f"*.{suffix}"))
    assert len(found) >= 2  # of the kernel and of the C function
    return found


def test_an_edited_helper_of_another_file_changes_the_result_in_the_next_process(copied):
    first, _ = run(copied)
    before = cached(copied, "nbc")
    assert run(copied) == (first, 0)
    assert cached(copied, "nbc") == before  # nothing was compiled anew
    helper = copied / "mjskip" / "rigid" / "_rigid_kernels.py"
    text, stamp = helper.read_text(), helper.stat()
    edited = text.replace("state[ROTATION] = 1.0 - scale", "state[ROTATION] = 1.25 - scale")
    assert edited != text
    helper.write_text(edited)
    os.utime(helper, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # as a package manager may leave it
    changed, _ = run(copied)
    assert changed != first
    helper.write_text(text)
    assert run(copied) == (first, 0)  # what was compiled of the old text is still there


def empty(file):
    file.write_bytes(b"")


def fill_with_garbage(file):
    file.write_bytes(bytes(range(256)) * 20)


def truncate(file):
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def blank_out(file):
    content = file.read_bytes()
    third = len(content) // 3
    file.write_bytes(content[:third] + bytes(third) + content[2 * third :])


def test_damaged_files_are_made_anew(copied):
    good, _ = run(copied)
    for suffix, damage in (
        ("nbi", empty), ("nbi", fill_with_garbage), ("nbc", truncate), ("nbc", blank_out),
    ):  # fmt: skip
        for file in cached(copied, suffix):
            damage(file)
        assert run(copied) == (good, 0), (suffix, damage.__name__)


def test_where_a_folder_cannot_be_made_the_code_runs_unkept_and_says_so_once(copied):
    good, _ = run(copied)
    shutil.rmtree(copied / "__pycache__")
    for name in ("__pycache__", "user"):
        (copied / name).write_text("a file where the folder should be")
    assert run(copied) == (good, 1)
    assert (copied / "__pycache__").is_file()


def test_on_a_full_disk_the_code_runs_unkept_and_says_so_once(copied):
    good, _ = run(copied)
    folder = copied / "__pycache__"
    shutil.rmtree(folder)
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no file system may be mounted here")
    try:
        (folder / "fill").write_bytes(b"0" * 4096)
        assert run(copied) == (good, 1)
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def test_the_files_that_a_file_imports_are_those_that_python_finds_in_it():
    for file in sorted(cache.PACKAGE.rglob("*.py")):
        names = set()
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        inside = (name.split(".")[1:] for name in names if name.startswith("mjskip."))
        paths = (cache.PACKAGE.joinpath(*parts).with_suffix(".py") for parts in inside)
        assert cache._imported(file) == {path for path in paths if path.is_file()}, file
