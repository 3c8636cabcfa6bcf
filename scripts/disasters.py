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
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

SWEEP = (
    "sweep",
    "lake",
    "--vary",
    "speed=8:12:8",
    "--vary",
    "attack=10:30:8",
    "--chunk",
    "8",
    "--threads",
    "1",
)
COMMANDS: dict[str, tuple[tuple[str, ...], str]] = {
    "run": (("run", "--save"), "run.nc"),
    "sweep": ((*SWEEP, "--save"), "sweep.zarr"),
    "plot of a sweep": ((*SWEEP, "--plot"), "sweep.png"),
    "film": (("run", "--size", "320x240", "--duration", "0.5", "--video"), "throw.mp4"),
    "strip": (("run", "--size", "320x240", "--strip", "2", "--picture"), "strip.png"),
}
"""Name: words, and the file that is written."""


def run(
    words: tuple[str, ...], target: Path, limit: Callable[[], None] | None = None
) -> tuple[int, str]:
    """Exit code and standard error of a command."""
    done = subprocess.run(
        [sys.executable, "-m", "mjskip", *words, str(target)],
        capture_output=True, text=True, preexec_fn=limit, check=False, timeout=600,
    )  # fmt: skip
    return done.returncode, done.stderr


def judge(code: int, errors: str, folder: Path, target: Path, old: bytes | None) -> list[str]:
    """What is wrong with how a command ended."""
    wrong = []
    if "Traceback" in errors or "Exception ignored" in errors:
        wrong.append("traceback")
    if code < 0 or code > 2:
        wrong.append(f"exit code {code}")
    if code and not any(line.startswith("mjskip: ") for line in errors.splitlines()):
        wrong.append("no line")
    if code and old is not None and (not target.is_file() or target.read_bytes() != old):
        wrong.append("previous file lost")
    wrong += [f"left {path.name}" for path in folder.iterdir() if ".part" in path.name]
    return wrong


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
        for name, (words, file) in COMMANDS.items():
            with disk() as folder:
                target, old = folder / file, None
                if not file.endswith(".zarr") and hardship not in ("full disk", "read-only disk"):
                    old = b"old"
                    target.write_bytes(old)
                code, errors = run(words, target, limit)
                wrong = judge(code, errors, folder, target, old)
                found[f"{name}, {hardship}"] = wrong
                said = [line for line in errors.splitlines() if line.startswith("mjskip: ")]
                print(f"{name}, {hardship}: code {code} {said[-1:]} {wrong}", file=sys.stderr)
                if wrong and "traceback" in wrong:
                    print(errors[-1500:], file=sys.stderr)
    return found


def kills(count: int, seed: int) -> dict[str, int]:
    """Kill commands at random moments and ask for the same again."""
    generator = random.Random(seed)
    counts: Counter[str] = Counter(
        {"killed": 0, "finished before": 0, "lost chunks": 0, "left": 0, "failed again": 0}
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lengths = {}
        for command, (words, file) in COMMANDS.items():
            started = time.monotonic()
            run(words, folder / f"whole_{file}")
            lengths[command] = time.monotonic() - started
        for number in range(count):
            command = generator.choice(sorted(COMMANDS))
            words, file = COMMANDS[command]
            target = folder / file
            process = subprocess.Popen(
                [sys.executable, "-m", "mjskip", *words, str(target)],
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            time.sleep(generator.uniform(0.2, 1.0) * lengths[command])
            process.send_signal(signal.SIGKILL)
            counts["killed" if process.wait() < 0 else "finished before"] += 1
            before = finished_chunks(target)
            if number % 5 == 4:  # and then in peace
                code, errors = run(words, target)
                if code or "Traceback" in errors:
                    counts["failed again"] += 1
                    print(errors[-800:], file=sys.stderr)
                part = f".{Path(file).stem}."
                counts["left"] += sum(p.name.startswith(part) for p in folder.iterdir())
            counts["lost chunks"] += len(before - finished_chunks(target))
            print(f"\r{number + 1} of {count} kills", end="", file=sys.stderr)
    print(file=sys.stderr)
    return dict(counts)


def finished_chunks(store: Path) -> set[tuple[str, bytes]]:
    """Chunks of a store with their bytes."""
    chunks = (store / "status" / "c").rglob("*") if store.suffix == ".zarr" else ()
    return {(str(path), path.read_bytes()) for path in chunks if path.is_file()}


def main() -> int:
    """All of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    wrong = {name: faults for name, faults in hardships().items() if faults}
    killed = kills(options.kills, options.seed)
    print(
        json.dumps(
            {"seed": options.seed, "hardships with faults": wrong, "kills": killed}, indent=1
        )
    )
    return int(bool(wrong) or bool(killed["lost chunks"] + killed["left"] + killed["failed again"]))


if __name__ == "__main__":
    sys.exit(main())
