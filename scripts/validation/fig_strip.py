"""Figures 4 and 6: a film strip of one throw, and where the stone was, from above and from the side.

The default scene: the pebble of 44 triangles over a lake that it stirs. 10 s short; the full form draws
larger pictures and writes the throw as a video.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _common import main, picture

from mjskip import load_scene, render_video, simulate
from mjskip.draw.render import Shot, frames
from mjskip.errors import RenderError

TITLE = "Figures 4 and 6: a film strip"

PICTURES_SHOWN = 8


def run(*, quick: bool, out: Path) -> dict[str, Any]:
    """Throw, draw, and place pictures at equal times until the last touch but planing."""
    scene = load_scene("lake")
    flight = simulate(scene)
    touches = [contact.entry for contact in flight.contacts]
    until = min(touches[-1].time + 0.15, float(flight.time[-1]))
    size = (480, 320) if quick else (960, 640)
    strip, failed = [], None
    try:
        strip = _strip(scene, flight, until, size)
        if not quick:
            render_video(scene, flight, out / "fig4_strip.mp4", size=(960, 640), fps=60.0)
    except RenderError as error:
        failed = str(error)
    draw(flight, touches, until, strip, out / "fig4_strip.png")
    throw = scene.throw
    return {
        "triangles": len(scene.stone.faces),
        "mass_g": 1e3 * scene.stone.mass,
        "throw": [
            throw.speed,
            throw.spin,
            float(np.degrees(throw.attack)),
            float(np.degrees(throw.descent)),
        ],
        "skips": flight.skips,
        "distance": touches[-1].position[0] - float(flight.position[0, 0]),
        "sideways": touches[-1].position[1],
        "end": flight.end,
        "drawn": len(strip),
        "video": None if quick or failed else "fig4_strip.mp4",
        "failed": failed,
    }


def _strip(scene: Any, flight: Any, until: float, size: tuple[int, int]) -> list[Any]:
    """PICTURES_SHOWN pictures at equal times."""
    times = until * np.arange(1, PICTURES_SHOWN + 1) / PICTURES_SHOWN
    return list(frames(scene, flight, Shot(camera="side", size=size), times=times))


def draw(flight: Any, touches: Any, until: float, strip: Any, path: Path) -> None:
    figure = plt.figure(figsize=(11, 7.0 if strip else 3.6), layout="constrained")
    parts = figure.subfigures(2, 1, height_ratios=(1.3, 1.0)) if strip else [None, figure]
    if strip:
        axes = parts[0].subplots(2, PICTURES_SHOWN // 2)
        for k, (ax, image) in enumerate(zip(axes.flat, strip, strict=True)):
            ax.imshow(image)
            ax.axis("off")
            ax.set_title(f"{(k + 1) * until / PICTURES_SHOWN:.2f} s", fontsize=9, pad=2)
    top, side = parts[1].subplots(2, 1, sharex=True, height_ratios=(1, 1))
    shown = flight.time <= until
    x, y, z = flight.position[shown].T
    start = x[0]
    every = max(1, int(0.04 / (flight.time[1] - flight.time[0])))
    for ax, across in ((top, y), (side, z)):
        ax.plot(x - start, 100 * across, color="#1f5fa8", lw=1)
        ax.plot((x - start)[::every], 100 * across[::every], "o", color="#1f5fa8", ms=4)
        for touch in touches:
            ax.axvline(touch.position[0] - start, color="#d9822b", lw=0.9, ls="--")
    side.axhline(0.0, color="#4aa3c7", lw=1.2)
    top.set_ylabel("to the left [cm]")
    side.set(ylabel="height [cm]", xlabel="distance [m]   (dots: every 40 ms; dashed: touches)")
    figure.savefig(path)
    plt.close(figure)


def page(found: dict[str, Any]) -> str:
    speed, spin, attack, descent = found["throw"]
    drawn = "" if found["drawn"] else f" Not drawn here: {found['failed']}"
    video = " [The throw as a video](validation/fig4_strip.mp4)." if found["video"] else ""
    return (
        picture(
            "fig4_strip.png", "One throw of the default scene; below, from above and from the side."
        )
        + f"\n\nThe pebble of {found['triangles']} triangles, {found['mass_g']:.0f} g, {speed:g} m/s, "
        f"{spin:.0f} rad/s, attack {attack:.0f}°, descent {descent:.0f}°: {found['skips']} skips over "
        f"{found['distance']:.2f} m, {100 * found['sideways']:+.0f} cm to the left.{drawn}{video}"
    )


if __name__ == "__main__":
    main(run, page)
