"""Pictures into files: video streamed to an encoder, or a folder of PNG."""

from __future__ import annotations

import contextlib
import math
import re
import signal
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from mjskip._typing import Image
from mjskip.errors import RenderError
from mjskip.files import check_folder, whole_file

"""One picture (height, width, 3), rows from the top."""

Progress = Callable[[int, int], None]
"""Called after each picture with how many are done and how many there will be."""

_H264 = ("h264", "yuv420p", "-preset veryfast -movflags +faststart")
_KINDS = {  # codec, pixels, arguments of ffmpeg
    ".mp4": _H264,
    ".mkv": _H264,
    ".mov": _H264,
    ".webp": ("libwebp_anim", "yuv420p", "-loop 0 -compression_level 4 -quality {quality}"),
    ".gif": ("gif", "pal8", "-loop 0"),  # mediapy picks a palette
}
_LARGEST = 4096  # [pixels]: the largest side of a common h264 level


def check_size(size: tuple[int, int]) -> None:
    """Raise ValueError for a (width, height) that h264 with 4:2:0 colour cannot hold."""
    sides = tuple(size)
    if len(sides) != 2 or any(int(n) != n or n % 2 or not 16 <= n <= _LARGEST for n in sides):
        raise ValueError(
            f"size is {size!r}: give width and height as even whole numbers from 16 to {_LARGEST}"
        )


def check_fps(fps: float) -> None:
    """Raise ValueError for a frame rate nobody can watch."""
    if not (math.isfinite(fps) and 1.0 <= fps <= 240.0):
        raise ValueError(f"fps is {fps!r}: give a number of frames per second from 1 to 240")


def check_video_path(path: Path) -> None:
    """Raise ValueError if no video can be written under this name."""
    if path.suffix.lower() not in _KINDS:
        raise ValueError(f"video name {path} ends in {path.suffix!r}: use {', '.join(_KINDS)}")
    if path.is_dir():
        raise ValueError(f"video name {path} is a folder: give the name of a file")
    check_folder(path.parent)


def write_video(
    images: Iterable[Image],
    path: str | Path,
    *,
    size: tuple[int, int],
    fps: float,
    total: int,
    progress: Progress | None = None,
    quality: int = 70,
) -> Path:
    """Encode pictures as they come; memory does not grow with their number.

    The file appears under its name when it is whole: it is written beside it and renamed, and
    nothing is left behind by an error or an interrupt.

    Args:
        images: (height, width, 3) each.
        path: .mp4, .mkv and .mov are h264; .webp and .gif move by themselves in a page.
        size: width and height [pixels].
        fps: frames per second.
        total: how many there will be.
        progress: called after each.
        quality: of WebP, 0 to 100.

    Raises:
        RenderError: the encoder is missing or fails.
    """
    path = Path(path)
    check_video_path(path)
    check_size(size)
    check_fps(fps)
    with whole_file(path) as part, _encoder(part, path, size, fps, quality) as add:
        for done, image in enumerate(images, start=1):
            add(image)
            if progress is not None:
                progress(done, total)
    return path


def write_pngs(
    images: Iterable[Image], folder: Path, *, total: int, progress: Progress | None = None
) -> list[Path]:
    """Write pictures as frame_0000.png, frame_0001.png, ... into a folder that exists."""
    import mediapy

    check_folder(folder)
    width = max(4, len(str(total - 1)))
    paths = []
    for done, image in enumerate(images, start=1):
        path = folder / f"frame_{done - 1:0{width}d}.png"
        with whole_file(path) as part:
            mediapy.write_image(part, image)
        paths.append(path)
        if progress is not None:
            progress(done, total)
    return paths


def ffmpeg() -> str:
    """Path of the encoder: the one that came with imageio-ffmpeg, so that none need be installed.

    Raises:
        RenderError: there is none.
    """
    import imageio_ffmpeg

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise RenderError(
            "no ffmpeg to encode video with: install it (Debian: apt install ffmpeg), or write "
            "frames instead"
        ) from error


@contextlib.contextmanager
def _encoder(
    path: Path, target: Path, size: tuple[int, int], fps: float, quality: int
) -> Iterator[Callable[[Image], Any]]:
    import mediapy

    mediapy.set_ffmpeg(ffmpeg())
    codec, pixels, arguments = _KINDS[path.suffix.lower()]
    writer = mediapy.VideoWriter(
        path,
        (size[1], size[0]),
        codec=codec,
        fps=fps,
        crf=18 if codec == "h264" else None,
        encoded_format=pixels,
        ffmpeg_args=arguments.format(quality=quality),
    )
    writer.__enter__()
    process = writer._popen  # mediapy leaves it running when it raises
    try:
        yield writer.add_image
        writer.close()
    except (BrokenPipeError, RuntimeError) as error:
        if not isinstance(error, BrokenPipeError) and process.poll() is None:
            raise  # not the encoder's: it still runs
        said = f"{error}\n{_last_line(process)}".strip().splitlines()
        reason = re.sub(r"^(\[[^]]*\] *)+", "", said[-1])  # which part of ffmpeg says it
        if reason.endswith(":") and (code := process.wait()) < 0:
            reason = str(signal.strsignal(-code))  # it was ended before it could say a word
        raise RenderError(
            f"{target} cannot be written, the video encoder failed: {reason}"
        ) from error
    finally:
        _end(process)


def _last_line(process: Any) -> str:
    """What a process that ended has left to say; nothing if it was read before."""
    with contextlib.suppress(OSError, ValueError):
        return str(process.stderr.read().decode(errors="replace"))
    return ""


def _end(process: Any) -> None:
    """Wait for an encoder that finished, stop one that did not, and close its pipes."""
    if process.poll() is None:
        process.kill()
    for pipe in (process.stdin, process.stderr):
        with contextlib.suppress(OSError):
            pipe.close()
    process.wait()
