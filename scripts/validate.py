"""Is it right? Runs every question in scripts/validation and writes the page that answers.

    python scripts/validate.py --quick     short form, under 3 minutes on two cores
    python scripts/validate.py             full form, three to four minutes; a bar shows how far it is

Writes docs/validation.md, docs/validation/*.png and docs/validation/results.json. Every number on the page
comes from the results of the same run.
"""

from __future__ import annotations

import argparse
import importlib
import json
import platform
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "validation"))

from _common import plain  # noqa: E402

from mjskip.hydro.laws import advice_table  # noqa: E402

QUESTIONS = (
    "oracle",
    "experiments",
    "planing",
    "unsteady",
    "deep_water",
    "others",
    "fig_spin",
    "fig_momentum",
    "fig_paths",
    "fig_strip",
    "fig_rings",
    "waves",
    "performance",
    "convergence",
    "timestep",
    "sensitivity",
)
"""In the order of the page; each is a file in scripts/validation that also runs by itself."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """One question, answered."""

    name: str
    module: ModuleType
    found: dict[str, Any]
    seconds: float


def answer(names: tuple[str, ...], *, quick: bool, out: Path) -> list[Part]:
    """Run the questions in order, with a bar."""
    parts = []
    with Progress(
        TextColumn("{task.description:28}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    ) as bar:
        task = bar.add_task("", total=len(names))
        for name in names:
            bar.update(task, description=name)
            module = importlib.import_module(name)
            begun = time.perf_counter()
            found = plain(module.run(quick=quick, out=out))
            seconds = time.perf_counter() - begun
            parts.append(Part(name=name, module=module, found=found, seconds=seconds))
            bar.advance(task)
    return parts


def provenance(parts: list[Part], *, quick: bool) -> dict[str, Any]:
    """What made the results."""
    return {
        "mjskip": version("mjskip"),
        "mujoco": version("mujoco"),
        "numpy": version("numpy"),
        "numba": version("numba"),
        "python": platform.python_version(),
        "commit": _commit(),
        "form": "quick" if quick else "full",
        "seconds": {part.name: round(part.seconds, 1) for part in parts},
    }


def _commit() -> str:
    """Short hash of the checkout, with a + if files that are tracked were changed since."""
    try:
        commit = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--exclude=*"],
            cwd=HERE, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit.stdout.strip()


def write_page(parts: list[Part], made: dict[str, Any]) -> str:
    """The whole page."""
    reproduction = importlib.import_module("reproduction")
    found = {part.name: part.found for part in parts}
    sections = ["# Is it right?", advice_table(), reproduction.summary(found)]
    for part in parts:
        sections.append(f"## {part.module.TITLE}\n\n{part.module.page(part.found).strip()}")
        if part.name == "others":
            sections.append(f"## {reproduction.TITLE}\n\n{reproduction.page(found)}")
    total = sum(part.seconds for part in parts)
    sections.append(
        "---\n\n"
        f"Written by `python scripts/validate.py{' --quick' if made['form'] == 'quick' else ''}` in "
        f"{total:.0f} s from mjskip {made['mjskip']} ({made['commit']}), MuJoCo {made['mujoco']}, Python "
        f"{made['python']}; all numbers in [results.json](validation/results.json). Each section is a file "
        "in `scripts/validation` that also runs by itself."
        + "".join(f" `{name}`: {why}." for name, why in made.get("rerun", {}).items())
    )
    return "\n\n".join(sections) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="the short form")
    parser.add_argument(
        "--only", nargs="+", choices=QUESTIONS, help="just these, to the screen; no page is written"
    )
    parser.add_argument("--out", type=Path, default=HERE.parent / "docs", help="folder of the page")
    arguments = parser.parse_args()
    pictures = arguments.out / "validation"
    pictures.mkdir(parents=True, exist_ok=True)
    names = tuple(n for n in QUESTIONS if arguments.only is None or n in arguments.only)
    parts = answer(names, quick=arguments.quick, out=pictures)
    if arguments.only:
        for part in parts:
            print(f"## {part.module.TITLE}\n\n{part.module.page(part.found)}\n")
        return
    made = provenance(parts, quick=arguments.quick)
    results = {"made_by": made} | {part.name: part.found for part in parts}
    (pictures / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    page = arguments.out / "validation.md"
    page.write_text(write_page(parts, made))
    print(f"{page} written in {sum(part.seconds for part in parts):.0f} s")


if __name__ == "__main__":
    main()
