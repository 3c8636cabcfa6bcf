"""What do full disks, limits and kills do to the commands that write? Counts, as JSON.

    python scripts/disasters.py [--kills 200] [--seed 0]

Every command that writes is run on a disk of 400 kB, on a read-only one (both need root), with a file size limit of
20 kB and with 1 GB of address space; then commands are killed at random moments and asked for again. Counted are
tracebacks, deaths by a signal, files that were there before and are not intact, and parts of files that remain
after the next write. 200 kills take about twenty minutes.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import random
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

SWEEP = tuple(
    shlex.split("sweep lake --vary speed=8:12:8 --vary attack=10:30:8 --chunk 8 --threads 1")
)
BEST = tuple(
    shlex.split("optimize lake --limit attack=10:30 --members 4 --population 6 --generations 3")
)
KILLED = ("run", "sweep", "optimize", "film")
"""Commands that are killed."""
FILMED = ("run", "--size", "320x240", "--duration", "0.5")
COMMANDS: dict[str, tuple[tuple[str, ...], str]] = {
    "run": (("run", "--save"), "run.nc"),
    "sweep": ((*SWEEP, "--save"), "sweep.zarr"),
    "plot of a sweep": ((*SWEEP, "--plot"), "sweep.png"),
    "optimize": (BEST, ""),
    "film": ((*FILMED, "--video"), "throw.mp4"),
    "frames": ((*FILMED, "--frames"), "frames"),
    "strip": (("run", "--size", "320x240", "--strip", "2", "--picture"), "strip.png"),
}
"""Name: words, and the file, store or folder that is written; none for what only prints."""


def command(name: str, folder: Path) -> list[str]:
    """The command line that writes to a folder."""
    words, file = COMMANDS[name]
    target = [str(folder / file)] if file else []
    if file == "frames":
        (folder / file).mkdir(exist_ok=True)
    return [sys.executable, "-m", "mjskip", *words, *target]


def run(
    name: str, folder: Path, limit: Callable[[], None] | None = None
) -> subprocess.CompletedProcess[str]:
    """A command from beginning to end."""
    return subprocess.run(
        command(name, folder), capture_output=True, text=True, preexec_fn=limit, check=False,
        timeout=600,
    )  # fmt: skip


def leftovers(folder: Path) -> list[str]:
    """Parts of files, at any depth."""
    return [f"left {path.name}" for path in folder.rglob("*") if ".part" in path.name]


def judge(done: subprocess.CompletedProcess[str], folder: Path, old: Path | None) -> list[str]:
    """What is wrong with how a command ended."""
    wrong, code = [], done.returncode
    if "Traceback" in done.stderr or "Exception ignored" in done.stderr:
        wrong.append("traceback")
    if code < 0 or code > 2:
        wrong.append(f"exit code {code}")
    if code and not any(line.startswith("mjskip: ") for line in done.stderr.splitlines()):
        wrong.append("no line")
    if code and old is not None and (not old.is_file() or old.read_bytes() != b"old"):
        wrong.append("previous file lost")
    return wrong + leftovers(folder)


@contextlib.contextmanager
def small_disk(read_only: bool) -> Iterator[Path]:
    """A disk of 400 kB."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", folder], check=True)
        try:
            (Path(folder) / "old").write_bytes(b"x" * 200_000)
            if read_only:
                subprocess.run(["mount", "-o", "remount,ro", folder], check=True)
            yield Path(folder)
        finally:
            subprocess.run(["umount", "-l", folder], check=True)


@contextlib.contextmanager
def plain_disk() -> Iterator[Path]:
    """Any folder."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def at_most(kind: int, size: int) -> Callable[[], None]:
    """Sets a limit in a child process."""
    return lambda: resource.setrlimit(kind, (size, size))


def hardships() -> dict[str, list[str]]:
    """Every command under every hardship; what went wrong with each."""
    cases = {
        "full disk": (lambda: small_disk(False), None),
        "read-only disk": (lambda: small_disk(True), None),
        "file size limit": (plain_disk, at_most(resource.RLIMIT_FSIZE, 40 * 512)),
        "1 GB of memory": (plain_disk, at_most(resource.RLIMIT_AS, 2**30)),
    }
    found = {}
    for hardship, (disk, limit) in cases.items():
        for name, (_, file) in COMMANDS.items():
            with disk() as folder:
                old = folder / file if "." in file and not file.endswith(".zarr") else None
                if old is not None and disk is plain_disk:
                    old.write_bytes(b"old")
                elif old is not None:
                    old = None
                if file == "frames" and hardship == "read-only disk":
                    continue  # its folder would have to be there
                done = run(name, folder, limit)
                wrong = judge(done, folder, old)
                found[f"{name}, {hardship}"] = wrong
                said = [line for line in done.stderr.splitlines() if line.startswith("mjskip: ")]
                print(
                    f"{name}, {hardship}: code {done.returncode} {said[-1:]} {wrong}",
                    file=sys.stderr,
                )
                if wrong:
                    print(done.stderr[-1500:], file=sys.stderr)
    return found


def kills(count: int, seed: int) -> dict[str, int]:
    """Kill commands at random moments and ask for the same again, now and then in peace."""
    generator = random.Random(seed)
    counts: Counter[str] = Counter(
        {
            "killed": 0, "finished before": 0, "in peace after": 0, "lost chunks": 0,
            "half files": 0, "left": 0, "failed again": 0, "kept chunks": 0,
        }
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as place:
        whole, lengths = Path(place) / "whole", {}
        whole.mkdir()
        for name in KILLED:
            started = time.monotonic()
            run(name, whole)
            lengths[name] = time.monotonic() - started
        files = [COMMANDS[name][1] for name in KILLED]
        sizes = {file: (whole / file).stat().st_size for file in files if file}
        for number in range(count):
            name = generator.choice(KILLED)
            folder = Path(place) / name
            folder.mkdir(exist_ok=True)
            before = finished_chunks(folder)
            process = subprocess.Popen(
                command(name, folder), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            time.sleep(generator.uniform(0.1, 1.0) * lengths[name])
            process.send_signal(signal.SIGKILL)
            counts["killed" if process.wait() < 0 else "finished before"] += 1
            counts["half files"] += half_written(folder, sizes)
            counts["lost chunks"] += len(before - finished_chunks(folder))
            if generator.random() < 0.25:
                before = finished_chunks(folder)
                again = run(name, folder)
                wrong = judge(again, folder, None)
                counts["in peace after"] += 1
                counts["left"] += len(leftovers(folder))
                counts["failed again"] += bool(again.returncode or "traceback" in wrong)
                counts["half files"] += half_written(folder, sizes)
                counts["lost chunks"] += len(before - finished_chunks(folder))
                counts["kept chunks"] += len(before)
                if wrong:
                    print(f"{name}: {wrong} {again.stderr[-800:]}", file=sys.stderr)
                shutil.rmtree(folder)
            print(f"{number + 1} of {count} kills: {dict(counts)}", file=sys.stderr, flush=True)
    return dict(counts)


def half_written(folder: Path, sizes: dict[str, int]) -> int:
    """Files that are there under their names and are not whole."""
    found = [path for path in folder.iterdir() if path.name in sizes and path.is_file()]
    return sum(abs(path.stat().st_size - sizes[path.name]) > 200 for path in found)


def finished_chunks(folder: Path) -> set[tuple[str, float, bytes]]:
    """Finished chunks of a store: where, since when, and with what bytes."""
    chunks = (folder / "sweep.zarr" / "status" / "c").rglob("*")
    return {
        (str(path), path.stat().st_mtime, path.read_bytes())
        for path in chunks
        if path.is_file() and ".part" not in path.name
    }


def main() -> int:
    """All of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kills-only", action="store_true", help="No disks, no limits.")
    options = parser.parse_args()
    found = {} if options.kills_only else hardships()
    wrong = {name: faults for name, faults in found.items() if faults}
    killed = kills(options.kills, options.seed)
    print(
        json.dumps(
            {"seed": options.seed, "hardships with faults": wrong, "kills": killed}, indent=1
        )
    )
    faults = ("lost chunks", "half files", "left", "failed again")
    return int(bool(wrong) or any(killed[name] for name in faults))


if __name__ == "__main__":
    sys.exit(main())
