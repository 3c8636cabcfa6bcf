"""Which OpenGL draws: EGL unless the user says otherwise, and what it is called."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Iterator
from typing import Any

from mjskip.errors import RenderError

_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader", "software")

_NO_EGL = (
    "install the EGL library (Debian: apt install libegl1 libgl1-mesa-dri), or set "
    "MUJOCO_GL to glfw or osmesa"
)


@contextlib.contextmanager
def offscreen() -> Iterator[None]:
    """Inside, MuJoCo makes its OpenGL contexts through EGL, which needs no display.

    MuJoCo picks its backend once, from the variable MUJOCO_GL as it is first imported, and its own
    default needs a display. A choice by the user in that variable is respected, "egl" also where it comes after
    that import.

    Raises:
        RenderError: no OpenGL context can be made here.
    """
    # everything of MuJoCo's that touches GL is imported here: physics needs no EGL library
    backend: Any = None
    chosen: Any = None
    try:
        if os.environ.get("MUJOCO_GL", "").strip().lower() in ("", "egl"):
            from mujoco.egl import GLContext
            from mujoco.rendering.classic import gl_context

            backend, chosen = gl_context, gl_context.GLContext
            backend.GLContext = GLContext
        yield
    except RenderError:
        raise
    except Exception as error:
        if _is_gl_trouble(error):
            raise RenderError(
                f"no OpenGL context can be made ({_line(error)}): {_NO_EGL}"
            ) from error
        raise
    finally:
        if backend is not None:
            backend.GLContext = chosen


@functools.cache
def _probe_context() -> tuple[str, str]:
    """Name of what draws and version of its shading language, from a context made for this."""
    with offscreen():
        from mujoco.rendering.classic import gl_context

        context = gl_context.GLContext(16, 16)
        try:
            with context.as_current():
                from OpenGL import GL  # type: ignore[import-untyped, unused-ignore]

                said = [
                    (GL.glGetString(name) or b"").decode(errors="replace")
                    for name in (GL.GL_RENDERER, GL.GL_SHADING_LANGUAGE_VERSION)
                ]
        finally:
            context.free()
    if not said[0]:
        raise RenderError(f"the OpenGL context does not work: {_NO_EGL}")
    return said[0], said[1]


def gl_renderer() -> str:
    """Name of what draws, as OpenGL gives it, for instance "llvmpipe (LLVM 19.1.7, 256 bits)".

    Raises:
        RenderError: no OpenGL context can be made here.
    """
    return _probe_context()[0]


def shaders_work() -> bool:
    """Whether OpenGL knows GLSL 3.30, in which the water is written.

    Raises:
        RenderError: no OpenGL context can be made here.
    """
    major, _, minor = (_probe_context()[1] or "0").partition(".")
    return (int(major), int(minor[:2] or 0)) >= (3, 30)


def is_software(name: str) -> bool:
    """Whether a renderer of this name draws on the processor instead of a graphics card."""
    return any(word in name.lower() for word in _SOFTWARE)


def _is_gl_trouble(error: Exception) -> bool:
    # PyOpenGL raises these two where its library is missing
    if isinstance(error, ImportError | AttributeError):
        return True
    text = str(error).lower()
    return type(error).__module__.startswith("OpenGL") or any(
        word in text for word in ("egl", "opengl", "gladload", "glfw", "osmesa", "framebuffer")
    )


def _line(error: Exception) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
