"""What a disk, a quota or a killed process does to files: one line, and never half a file."""

import ast
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

import mjskip
from mjskip.errors import MjskipError
from mjskip.files import check_folder, check_target, whole_file
from mjskip.sweeps.plot import check_picture
from mjskip.sweeps.store import open_sweep


def test_a_file_appears_whole_and_replaces_the_one_before(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("old")
    with whole_file(target) as part:
        part.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def write_half_and_raise(target, error):
    with whole_file(target) as part:
        part.write_text("half")
        raise error


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (
            OSError(28, "No space left on device"),
            "a.txt cannot be written .No space left on device",
        ),
        (OSError(27, "File too large"), "File too large"),
        (OSError(30, "Read-only file system"), "Read-only file system"),
        (OSError("unable to lock"), "unable to lock"),
        (MemoryError(), "out of memory"),
    ],
)
def test_what_the_disk_refuses_is_one_line_and_the_file_before_is_kept(tmp_path, error, says):
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(MjskipError, match=says) as refused:
        write_half_and_raise(target, error)
    assert "\n" not in str(refused.value)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_interrupt_leaves_nothing_behind(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        write_half_and_raise(tmp_path / "a.txt", KeyboardInterrupt())
    assert not list(tmp_path.iterdir())


def test_parts_of_processes_that_have_ended_are_removed_others_are_not(tmp_path):
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], stdout=-1)
    gone = int(ended.stdout)
    (tmp_path / f".a.{gone}.part.nc").write_text("half")
    (tmp_path / f".a.{gone}0000000.part.nc").mkdir()  # a folder, of a process that cannot be
    running = tmp_path / f".a.{os.getppid()}.part.nc"
    other = tmp_path / f".b.{gone}.part.nc"
    running.touch()
    other.touch()
    with whole_file(tmp_path / "a.nc") as part:
        part.touch()
    assert {p.name for p in tmp_path.iterdir()} == {"a.nc", running.name, other.name}


def test_folders_that_cannot_take_a_file_are_refused_before_any_work(tmp_path):
    with pytest.raises(MjskipError, match=r"folder .*nowhere does not exist: create it"):
        check_folder(tmp_path / "nowhere")
    with pytest.raises(MjskipError, match="is a folder: name a file"), whole_file(tmp_path):
        pass


WRITERS = {
    "to_netcdf", "savefig", "savez", "save_image", "write_bytes", "write_text", "write_image", "export", "tofile",
}  # fmt: skip
OWN_FOLDERS = {"play/thrown.py": "a folder of the process, removed with it"}


def writes(file):
    """Calls that write a file and are inside neither `whole_file` nor a temporary folder."""

    def is_safe(node):
        return isinstance(node, ast.With) and any(
            isinstance(item.context_expr, ast.Call)
            and getattr(item.context_expr.func, "id", "") in ("whole_file", "TemporaryDirectory")
            for item in node.items
        )

    def walk(node, safe):
        safe = safe or is_safe(node)
        if isinstance(node, ast.Call) and not safe:
            name = getattr(node.func, "attr", "")
            text = " ".join(ast.unparse(a) for a in [*node.args, *(k.value for k in node.keywords)])
            opened = name == "open" and ("'w" in text or "'a" in text or "'x" in text)
            to_memory = name == "to_netcdf" and not node.args
            if opened or (name in WRITERS and not to_memory):
                yield f"{file.name}:{node.lineno} {name}"
        for child in ast.iter_child_nodes(node):
            yield from walk(child, safe)

    yield from walk(ast.parse(file.read_text()), False)


def test_every_file_of_the_package_is_written_by_the_one_function():
    package = Path(mjskip.__file__).parent
    found = [
        line
        for file in sorted(package.rglob("*.py"))
        if str(file.relative_to(package)) not in OWN_FOLDERS
        for line in writes(file)
    ]
    assert found == []


@pytest.mark.parametrize("what", ["trajectory", "surface", "picture of a sweep", "hydrodynamics"])
def test_every_kind_of_result_refuses_a_missing_folder_by_the_same_error(tmp_path, what):
    target = tmp_path / "no" / "file"
    run = mjskip.integrate(
        mjskip.Stone.pebble(), mjskip.Throw(), limits=mjskip.Limits(duration=0.01)
    )
    write = {
        "trajectory": lambda: run.save(target.with_suffix(".nc")),
        "surface": lambda: mjskip.HeightField((8, 8)).save(target.with_suffix(".npz")),
        "picture of a sweep": lambda: check_picture(target.with_suffix(".png")),
        "hydrodynamics": lambda: check_target(target.with_suffix(".nc")),
    }[what]
    with pytest.raises(MjskipError, match=r"folder .*no does not exist: create it") as refused:
        write()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("what", ["trajectory", "surface", "sweep", "scene", "mesh"])
def test_every_kind_of_file_that_is_missing_is_refused_by_the_same_error(tmp_path, what):
    name = str(tmp_path / "nothing")
    read = {
        "trajectory": lambda: mjskip.Trajectory.load(f"{name}.nc"),
        "surface": lambda: mjskip.HeightField.load(f"{name}.npz"),
        "sweep": lambda: open_sweep(f"{name}.zarr"),
        "scene": lambda: mjskip.load_scene(f"{name}.xml"),
        "mesh": lambda: mjskip.Stone.from_mesh(f"{name}.stl", density=2000.0),
    }[what]
    with pytest.raises(MjskipError, match="nothing") as refused:
        read()
    assert "\n" not in str(refused.value)


def limited():
    resource.setrlimit(resource.RLIMIT_FSIZE, (40 * 512, 40 * 512))


def test_a_file_size_limit_ends_a_run_in_one_line_with_code_2(tmp_path):
    saved = tmp_path / "run.nc"
    saved.write_text("old")
    command = [sys.executable, "-m", "mjskip", "run", "--save", str(saved)]
    run = subprocess.run(
        command, preexec_fn=limited, capture_output=True, text=True, check=False, timeout=300
    )
    assert run.returncode == 2, run.stderr
    (line,) = [row for row in run.stderr.splitlines() if "cannot be written" in row]
    assert line.startswith(f"mjskip: {saved} cannot be written (File too large)")
    assert "Traceback" not in run.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]
    assert saved.read_text() == "old"
