"""What does mjskip look like? Makes docs/gallery.md, its pictures, and the film in README.

Every picture stands over the command that makes the like of it. Takes some minutes on two cores; all
files together stay under 3 MB, README's film under 1 MB.

    python scripts/gallery.py [NAME ...]
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pictures

from mjskip import Limits, Scene, Trajectory, load_scene, simulate
from mjskip.draw.film import compose, duel_of
from mjskip.draw.overlay import caption, numbers_at
from mjskip.draw.plot import plot_runs
from mjskip.draw.render import Shot, frames, shot_times
from mjskip.draw.video import Image, write_video
from mjskip.throws.simulate import simulate_all
from mjskip.waves.recording import SurfaceFrames

DOCS = Path(__file__).parent.parent / "docs"
CUT = 24  # rows of sky above README's film [pixels]
SHARP = 2  # pictures are drawn this much larger and shrunk: edges are smooth


@dataclass(frozen=True, kw_only=True)
class Exhibit:
    """A picture, what it shows, and the command under it."""

    name: str
    text: str
    command: str
    make: Callable[[Path], None]


def filmed(
    scene: Scene, flights: Any, shot: Shot, *, times: Any = None, follow: Trajectory | None = None
) -> Iterator[Image]:
    """Frames drawn larger and shrunk."""
    size = shot.size
    large = replace(shot, size=(SHARP * size[0], SHARP * size[1]))
    images = frames(scene, flights, large, times=times, follow=follow)
    with contextlib.closing(images):
        for image in images:
            yield np.asarray(Pictures.fromarray(image).resize(size, Pictures.Resampling.BOX))


def film(path: Path) -> None:
    """The film in README: a boat in a swell, and beside it the default throw in slow motion."""
    wide, high, rate = 400, 300, 15.0
    scene = load_scene("lake")
    flights = simulate_all(scene)
    shot = Shot(size=(wide, high), fps=rate, slow=3.5, linger=1.0, caption=False)
    times = shot_times(flights, shot)
    boat = load_scene("boat_in_swell", sea="hs=0.22 tp=1.9 direction=180 spreading=15 seed=4")
    count = len(times)
    afloat = simulate_all(
        boat, limits=Limits(duration=1.0 + count / rate), record=SurfaceFrames(rate=rate)
    )
    moments = 1.0 + np.arange(count) / rate
    left = filmed(boat, afloat, replace(shot, camera="quarter"), times=moments)
    right = filmed(scene, flights, shot, times=times)

    def images() -> Iterator[Image]:
        for time, one, other in zip(times, left, right, strict=True):
            named = other.copy()
            caption(named, numbers_at(flights[scene.body], float(time)))
            yield np.ascontiguousarray(np.hstack([one, named])[CUT:])

    write_video(images(), path, size=(2 * wide, high - CUT), fps=rate, total=count, quality=45)


def still(
    scene_name: str, camera: str, time: float, *, forces: bool = False, sea: str | None = None
) -> Callable[[Path], None]:
    """One moment by one camera."""

    def make(path: Path) -> None:
        scene = load_scene(scene_name, sea=sea)
        shot = Shot(size=(640, 400), camera=camera, forces=forces, spray=not forces)
        record = SurfaceFrames(rate=20.0) if scene.afloat else None
        flights = simulate_all(scene, limits=Limits(duration=time + 1.0), record=record)
        (image,) = filmed(scene, flights, shot, times=np.array([time]))
        save(image, path)

    return make


def strip(path: Path) -> None:
    """Six moments of the default throw."""
    scene = load_scene("lake")
    flights = simulate_all(scene)
    follow = flights[scene.body]
    times = np.array([0.1, 0.19, 0.3, 0.44, 0.57, 0.7])
    shot = Shot(size=(400, 260), caption=False)
    pictures = []
    for time, image in zip(
        times, filmed(scene, flights, shot, times=times, follow=follow), strict=True
    ):
        named = image.copy()
        caption(named, f"{time:.2f} s", corner="top")
        pictures.append(named)
    save(compose(pictures), path)


def duel(path: Path) -> None:
    """The same moment with spin and without."""
    scene = load_scene("duel")
    sides = duel_of(scene, simulate_all(scene))
    halves = []
    for title, (one, flight) in sides.items():
        (image,) = filmed(one, flight, Shot(size=(480, 360)), times=np.array([0.45]))
        named = image.copy()
        caption(named, title, corner="top")
        halves.append(named)
    save(compose(halves), path)


def curves(path: Path) -> None:
    """A page about two throws."""
    runs: dict[str, Trajectory] = {
        "15 rev/s": simulate("lake"),
        "no spin": simulate(load_scene("lake").rethrow(spin=0.0)),
    }
    plot_runs(runs, path)


def save(image: Image, path: Path) -> None:
    """As WebP: small, and every browser shows it."""
    Pictures.fromarray(image).save(path, quality=80, method=6)


EXHIBITS = (
    Exhibit(
        name="strip.webp",
        text="Three skips: the stone at six moments.",
        command="mjskip run --strip 6 --picture strip.png",
        make=strip,
    ),
    Exhibit(
        name="chase.webp",
        text="From behind, as it leaves the water for the second time.",
        command="mjskip run --video throw.mp4 --camera chase --slow 4",
        make=still("lake", "chase", 0.47),
    ),
    Exhibit(
        name="underwater.webp",
        text="From below: Snell's window, total reflection around it, and the furrow of a touch.",
        command="mjskip run --video throw.mp4 --camera underwater --slow 4",
        make=still("lake", "underwater", 0.46),
    ),
    Exhibit(
        name="top.webp",
        text="From above: drops, the stone's shadow on the bottom, and caustics of the first touch.",
        command="mjskip run --video throw.mp4 --camera top --slow 4",
        make=still("lake", "top", 0.26),
    ),
    Exhibit(
        name="forces.webp",
        text="Forces: an arrow for the water, wetted faces in orange, the centre of buoyancy in yellow.",
        command="mjskip run --video forces.mp4 --forces --no-spray --slow 8",
        make=still("lake", "side", 0.17, forces=True),
    ),
    Exhibit(
        name="duel.webp",
        text="The same throw with spin and without.",
        command="mjskip run duel --side-by-side --video duel.mp4 --slow 4",
        make=duel,
    ),
    Exhibit(
        name="disc.webp",
        text="The aluminium disc of Clanet, Hersen and Bocquet, 65 rev/s.",
        command="mjskip run clanet_disc --video disc.mp4 --slow 8",
        make=still("clanet_disc", "side", 0.12),
    ),
    Exhibit(
        name="thrower.webp",
        text="A robot's arm has thrown.",
        command="mjskip run thrower --video thrower.mp4 --slow 4",
        make=still("thrower", "side", 0.5),
    ),
    Exhibit(
        name="boat.webp",
        text="What floats is filmed as throws are.",
        command="mjskip run boat --video boat.mp4 --duration 3",
        make=still("boat", "side", 1.0),
    ),
    Exhibit(
        name="swell.webp",
        text="A boat at anchor in a swell, with the sea that it feels.",
        command='mjskip run boat_in_swell --sea "hs=0.2 tp=2" --camera quarter --video swell.mp4',
        make=still("boat_in_swell", "quarter", 2.0, sea="hs=0.2 tp=2"),
    ),
    Exhibit(
        name="quadruped.webp",
        text="A quadruped wades.",
        command="mjskip run quadruped_wading --video wading.mp4",
        make=still("quadruped_wading", "side", 1.5),
    ),
    Exhibit(
        name="curves.png",
        text="Two throws on one page.",
        command="mjskip run --save spin.nc; mjskip run --spin 0 --save still.nc; "
        "mjskip plot spin.nc still.nc -o curves.png",
        make=curves,
    ),
)


def page() -> str:
    """The text of docs/gallery.md."""
    parts = [
        "# Gallery\n",
        "Made by `python scripts/gallery.py`. The water is one GLSL source in MuJoCo's own OpenGL context, see "
        "[Drawing water](drawing.md): Fresnel's reflection of sky, sun and banks, Snell's refraction to the bottom, "
        "Beer-Lambert absorption, caustics from the surface's curvature. Two things are drawn only, and no stone feels "
        "them: a breath of wind on the water, and spray. Drops and sheet follow from the recorded load at the wet "
        "edge and never hold more momentum or energy than the stone gave to the water; `--no-spray` leaves them out.\n",
    ]
    for exhibit in EXHIBITS:
        parts.append(f"## {exhibit.text}\n")
        parts.append(f"![{exhibit.text}](gallery/{exhibit.name})\n")
        parts.append(f"```sh\n{exhibit.command}\n```\n")
    return "\n".join(parts)


def main() -> None:
    """Make all, or those named."""
    folder = DOCS / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    chosen = set(sys.argv[1:])
    if not chosen or "skip.webp" in chosen:
        film(DOCS / "skip.webp")
    for exhibit in EXHIBITS:
        if not chosen or exhibit.name in chosen:
            exhibit.make(folder / exhibit.name)
            print(exhibit.name, (folder / exhibit.name).stat().st_size)
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")
    sizes = [p.stat().st_size for p in [DOCS / "skip.webp", *folder.iterdir()]]
    print(f"skip.webp {sizes[0] / 1e6:.2f} MB, all {sum(sizes) / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
