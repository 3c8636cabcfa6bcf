"""Drawn over a picture: the stone's trail, where it touched the water, a line of numbers."""

from __future__ import annotations

import functools
import math

import numpy as np

from mjskip._typing import Array, Image, SingleArray
from mjskip.draw._draw_kernels import stroke
from mjskip.draw.eye import PinholeCamera
from mjskip.rigid.attitude import matrices
from mjskip.throws.trajectory import Trajectory, pose_at

TRAIL = 0.35
"""How long the trail stays [s]."""

_CLEAR = 0.025  # the trail comes in over this time behind the stone and leaves it clear [s]
_STEPS = 70  # pieces of the trail
_RING = 0.10  # [m] radius of the mark of a touch
_AROUND = 40
_SHALLOW = 0.02  # [m]
_COLOURS = ((255, 236, 170), (170, 220, 255), (255, 190, 170), (190, 255, 190))


class Overlay:
    """What is drawn over the pictures of one stone.

    Args of `draw` are the moment and the camera; the picture is altered in place.
    """

    def __init__(
        self, flight: Trajectory, *, trail: bool = True, marks: bool = True, number: int = 0
    ) -> None:
        """Prepare.

        Args:
            flight: of the stone.
            trail: whether its path fades behind it.
            marks: whether a ring stays where it touched.
            number: of the stone among several: picks a colour.
        """
        self._flight = flight
        self._trail = trail
        self._marks = marks
        self._colour = np.array(_COLOURS[number % len(_COLOURS)], np.float64)

    def draw(self, image: Image, time: float, eye: PinholeCamera) -> None:
        """Add trail and marks as they are at a time [s]."""
        high, wide, _ = image.shape
        cover = np.zeros((high, wide), np.float32)
        size = high / 480.0
        if self._marks:
            turn = np.linspace(0.0, 2.0 * math.pi, _AROUND + 1)
            ring = _RING * np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
            for contact in self._flight.contacts:
                age = time - contact.entry.time
                if age > 0.0:
                    centre = np.array([*contact.entry.position[:2], 0.0])
                    strength = 0.12 + 0.45 * math.exp(-age / 0.4)
                    self._line(cover, eye, centre + ring, np.full(_AROUND, strength), 0.7 * size)
        if self._trail:
            end = min(time, float(self._flight.time[-1]))
            times = np.linspace(max(time - TRAIL, float(self._flight.time[0])), end, _STEPS + 1)
            if times[-1] > times[0]:
                places = [np.interp(times, self._flight.time, x) for x in self._flight.position.T]
                behind = time - times[1:]
                fresh = (
                    np.clip(1.0 - behind / TRAIL, 0.0, 1.0)
                    * np.clip(behind / _CLEAR, 0.0, 1.0) ** 2
                )
                self._line(cover, eye, np.column_stack(places), 0.75 * fresh, 1.1 * size)
        where = cover > 0.0
        share = cover[where][:, None]
        image[where] = ((1.0 - share) * image[where] + share * self._colour).astype(np.uint8)

    def _line(
        self,
        cover: SingleArray,
        eye: PinholeCamera,
        points: Array,
        strength: Array,
        radius: float,
    ) -> None:
        """A line through points in the world, each piece as strong as given."""
        high, wide = cover.shape
        place, ahead = eye.project(points)
        # seen through the surface it would be elsewhere
        same_side = points[:, 2] > -_SHALLOW if eye.position[2] > 0.0 else points[:, 2] < _SHALLOW
        with np.errstate(invalid="ignore"):
            pixels = np.column_stack(
                [0.5 * (place[:, 0] + 1.0) * wide - 0.5, 0.5 * (1.0 - place[:, 1]) * high - 0.5]
            )
        for k in range(len(points) - 1):
            ends = pixels[k : k + 2]
            seen = same_side[k] and same_side[k + 1] and min(ahead[k], ahead[k + 1]) > 0.02
            if seen and np.abs(ends).max() < 4.0 * wide:
                (x0, y0), (x1, y1) = ends.tolist()
                stroke(cover, x0, y0, x1, y1, radius, float(strength[k]))


def numbers_at(flight: Trajectory, time: float) -> str:
    """Speed, spin and skips so far, as a line; when the flight is over, only how it was. Of what floats: its attitude."""
    if flight.attributes.get("afloat"):
        now = min(time, float(flight.time[-1]))
        up = matrices(pose_at(flight, now)[1])[2]
        trim, heel = (math.degrees(math.asin(min(max(u, -1.0), 1.0))) + 0.0 for u in up[:2])
        return f"{now:.1f} s  ·  trim {trim:+.1f}°  ·  heel {heel:+.1f}°"
    skips = sum(1 for c in flight.contacts if c.exit is not None and c.exit.time <= time)
    skips = min(skips, flight.skips)
    counted = f"{skips} skip{'' if skips == 1 else 's'}"
    if time > flight.time[-1] + 1e-9:
        return f"{counted}, {flight.end}"
    at = max(int(np.searchsorted(flight.time, time, side="right")) - 1, 0)
    speed = float(np.linalg.norm(flight.velocity[at]))
    # about the axis of greatest inertia; a stone that is not thrown keeps none
    axis = _axis(flight)
    spin = abs(float(flight.omega[at] @ (matrices(flight.q[at]) @ axis))) / (2.0 * math.pi)
    return f"{speed:.1f} m/s  ·  {spin:.0f} rev/s  ·  {counted}"


def _axis(flight: Trajectory) -> Array:
    """The axis in the body along which it had the most spin at first: where L is, it is omega too."""
    turned = matrices(flight.q[0]).T @ flight.omega[0]
    size = float(np.linalg.norm(turned))
    return turned / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])


def caption(image: Image, text: str, *, corner: str = "bottom") -> None:
    """Write a line of text into the lower (or upper) left corner of a picture, in place."""
    high, wide, _ = image.shape
    mask = _lettering(text, max(11, round(high / 30)))
    rows, columns = min(mask.shape[0], high), min(mask.shape[1], wide)
    margin = max(4, high // 48)
    top = high - rows - margin if corner == "bottom" else margin
    top, left = max(top, 0), min(margin, wide - columns)
    part = image[top : top + rows, left : left + columns].astype(np.float32)
    letters = mask[:rows, :columns].astype(np.float32) / 255.0
    shade = np.zeros_like(letters)
    shade[1:, 1:] = letters[:-1, :-1]
    part *= 1.0 - 0.55 * shade[..., None]
    part += letters[..., None] * (250.0 - part)
    image[top : top + rows, left : left + columns] = part.astype(np.uint8)


@functools.lru_cache(maxsize=64)
def _lettering(text: str, size: int) -> Image:
    from PIL import Image as Pictures
    from PIL import ImageDraw, ImageFont

    font = ImageFont.load_default(size)
    left, top, right, bottom = font.getbbox(text)
    mask = Pictures.new("L", (math.ceil(right - left) + 2, math.ceil(bottom - top) + 2))
    ImageDraw.Draw(mask).text((-left, -top), text, fill=255, font=font)
    return np.asarray(mask)
