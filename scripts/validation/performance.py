"""Section 5: 44 triangles and 500 x 500 water vertices, drawn: how many frames a second, and what costs?

A frame is 1/60 s: the stone at 0.5 ms RK4 in MuJoCo, the water, the picture at 640 x 480. Also the water
alone over its side (section 6), and whether another force law slows the kernel. 30 s short, 60 s full.
"""

from __future__ import annotations

import os
import platform
import statistics
import time
from pathlib import Path
from typing import Any

from _common import LAWS, main, table

from mjskip import HeightField, Limits, Throw, Water, integrate, load_scene, simulate
from mjskip.draw.gl import gl_renderer, is_software
from mjskip.draw.render import Shot, frames
from mjskip.errors import RenderError

TITLE = "Section 5: speed, and what it is spent on"

FPS = 60.0
SIZE = (640, 480)
CELLS = 500
"""Along a side of the water, as in the paper; what is drawn around the stone is the scene's."""


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """Times of the parts of a frame; medians."""
    scene = load_scene("lake")
    simulate(scene, limits=Limits(duration=0.3))  # compiles
    count = 40 if quick else 150
    stone = statistics.median(_stone(scene) for _ in range(5))
    water = _median(_water_frame(), count)
    drawn, renderer = _drawing(scene, count)
    total = stone + (drawn if drawn is not None else water)
    parts = {
        "stone": stone,
        "water": water,
        "drawing": None if drawn is None else max(drawn - water, 0.0),
    }
    sides = (125, 250, 500, 1000, 2000)
    by_side = [_least(_water_step(n), 30) for n in sides]
    software = is_software(renderer) if renderer else None
    return {
        "setup": f"lake scene, {len(scene.stone.faces)} triangles, "
        f"{CELLS} × {CELLS} cells, 640 × 480, "
        f"{renderer or 'not drawn'}",
        "processor": platform.processor() or platform.machine(),
        "renderer": renderer,
        "load": os.getloadavg()[0],
        "processors": os.cpu_count(),
        "seconds": parts,
        "frames_per_second": 1.0 / total,
        "undrawn_per_second": 1.0 / (stone + water),
        "shares": ", ".join(
            f"{name} {100 * value / total:.0f}%"
            for name, value in parts.items()
            if value is not None
        ),
        "why": "drawn by the processor, not by a graphics card" if software else "on this machine",
        "sides": sides,
        "side_seconds": by_side,
        "laws": _laws(8 if quick else 20),
    }


def _median(do: Any, count: int) -> float:
    do()
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        do()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def _least(do: Any, count: int) -> float:
    """Processor seconds of the fastest of many: what others do on the machine counts least."""
    do()
    times = []
    for _ in range(count):
        begun = time.process_time()
        do()
        times.append(time.process_time() - begun)
    return min(times)


def _stone(scene: Any) -> float:
    """Seconds for the stone to move on by one frame: mean over flight and touches."""
    begun = time.perf_counter()
    flight = simulate(scene, limits=Limits(duration=1.0))
    return (time.perf_counter() - begun) / (float(flight.time[-1]) * FPS)


def _water_frame() -> Any:
    field = HeightField((CELLS, CELLS))

    def do() -> None:
        field.press(0.0, 0.0, force=1.0, radius=0.05)
        field.advance(1.0 / FPS)

    return do


def _water_step(side: int) -> Any:
    field = HeightField((side, side), threads=1)
    field.displace(0.0, 0.0, height=0.01, radius=0.2)
    step = 0.5 * field.max_timestep
    return lambda: field.step(step)


def _drawing(scene: Any, count: int) -> tuple[float | None, str | None]:
    """Seconds for water and picture of a frame, and what draws it."""
    try:
        images = frames(scene, simulate(scene), Shot(camera="side", size=SIZE, fps=FPS))
        seconds = _median(lambda: next(images), min(count, 60))
        images.close()
        return seconds, gl_renderer()
    except RenderError:
        return None, None


def _laws(repeats: int) -> dict[str, float]:
    """Seconds of a fixed march through water by each law, over the default's, alternating."""
    scene = load_scene("clanet_disc")
    throw = Throw.from_degrees(speed=0.05, spin=0.0, attack=20.0, descent=90.0, height=0.0)
    times: dict[str, list[float]] = {law: [] for law in LAWS}
    limits = Limits(duration=0.2, sink_depth=1e9, max_contact=1e9)
    for repeat in range(repeats + 1):
        for law in LAWS:
            begun = time.process_time()
            integrate(
                scene.stone,
                throw,
                water=Water(law=law, air_density=0.0),
                timestep=5e-5,
                limits=limits,
            )
            if repeat:
                times[law].append(time.process_time() - begun)
    least = {law: min(found) for law, found in times.items()}
    return {law: value / least["lee2010"] for law, value in least.items()}


def page(found: dict[str, Any]) -> str:
    parts = found["seconds"]
    rows = [(name, None if v is None else 1e3 * v) for name, v in parts.items()]
    sides = [
        (n, 1e3 * s, 1e9 * s / n**2)
        for n, s in zip(found["sides"], found["side_seconds"], strict=True)
    ]
    laws = ", ".join(f"`{law}` {ratio:.2f}" for law, ratio in found["laws"].items())
    return (
        f"**{found['frames_per_second']:.0f} frames a second** ({found['shares']}): {found['setup']}. Without "
        f"drawing {found['undrawn_per_second']:.0f}. The paper claims above 90 on a Core 2 at 1.86 GHz with a "
        f"GeForce 9600. Wall time; the machine's load was {found['load']:.1f} on {found['processors']} processors: "
        "above their number, others were using it and the frames are too few. The water alone and the laws "
        "are timed by processor time.\n\n"
        + table(("part of a frame of 1/60 s", "ms"), rows)
        + "\n\nThe water alone, one thread. No single power fits: small sides pay overhead, large ones leave the "
        "processor's caches.\n\n"
        + table(("side", "ms a step", "ns a vertex"), sides)
        + "\n\nAll laws are one kernel; processor time of a slow sinking over that of the default: "
        f"{laws}. This compares the laws with each other, not with a kernel that knows only one."
    )


if __name__ == "__main__":
    main(run, page)
