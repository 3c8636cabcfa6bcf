"""The water as OpenGL draws it: `water.glsl`'s programs, and the textures they read and write."""

from __future__ import annotations

import contextlib
import ctypes
import functools
from collections.abc import Iterator, Mapping
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._typing import Flags, Image, SingleArray
from mjskip.draw.appearance import ripples
from mjskip.draw.surface import ShaderSurface
from mjskip.errors import RenderError

MAX_BODIES = 32
"""Bodies that move and are mirrored, cast shadows or are seen through water."""

UNITS = {
    name: unit
    for unit, name in enumerate(
        (
            "picture", "distances", "heights", "bends", "tallest", "ripples", "bottom", "soundings", "scenery",
            "ranges", "shape", "water",
        )
    )
}  # fmt: skip
"""Texture units of the samplers of `water.glsl`; the first are MuJoCo's too, and put back."""

VIEW_ROWS = 16 + 4 * MAX_BODIES
"""Rows of four numbers of `water.glsl`'s View."""

TILE = 32
"""Pixels a side of the tiles that a picture is drawn in."""

_TILES = """
out vec2 at;
uniform ivec3 tiles;
void main()
{
    int tile = gl_VertexID / 6, corner = gl_VertexID % 6;
    ivec2 place = ivec2(tile % tiles.z, tile / tiles.z);
    if (corner == 1 || corner == 3 || corner == 4) place.x += 1;
    if (corner == 2 || corner == 4 || corner == 5) place.y += 1;
    at = vec2(place) * TILE / vec2(tiles.xy);
    gl_Position = vec4(2.0 * at - 1.0, 0.0, 1.0);
#ifdef FLIPPED
    gl_Position.y = -gl_Position.y;
#endif
}
"""
"""Two triangles for each tile of a picture, counted in rows from the lower left."""

_SMALL = 320 * 240

_FLIPPED = ("PICTURE", "SURE", "COPY", "DISTANCE")
"""Passes that turn a picture over, for rows from the top."""


def gl() -> Any:
    """PyOpenGL, which looks for a library when it is imported: not before something is drawn."""
    from OpenGL import GL  # type: ignore[import-untyped, unused-ignore]

    return GL


@functools.cache
def _source(name: str) -> str:
    return files("mjskip.draw").joinpath(name).read_text(encoding="utf-8")


def program(*parts: str, spray: bool = False) -> int:
    """Compile parts of `water.glsl`, or of `spray.glsl`.

    Raises:
        RenderError: the driver refuses it.
    """
    from OpenGL.GL import shaders  # type: ignore[import-untyped, unused-ignore]

    fragment = _source("spray.glsl" if spray else "water.glsl")
    vertex = "#define VERTEX\n" + fragment if spray else _TILES
    head = f"#version 330\n#define TILE {TILE}.0\n" + "".join(f"#define {part}\n" for part in parts)
    try:
        made = [
            shaders.compileShader(head + text, stage)
            for text, stage in (
                (vertex, gl().GL_VERTEX_SHADER),
                (fragment, gl().GL_FRAGMENT_SHADER),
            )
        ]
        found = gl().glCreateProgram()
        for shader in made:
            gl().glAttachShader(found, shader)
        gl().glLinkProgram(found)
        if not gl().glGetProgramiv(found, gl().GL_LINK_STATUS):
            raise RuntimeError(gl().glGetProgramInfoLog(found).decode(errors="replace"))
        for shader in made:
            gl().glDeleteShader(shader)
    except (RuntimeError, shaders.ShaderCompilationError) as error:
        said = str(error.args[0]).strip().splitlines()[0]
        raise RenderError(
            f"OpenGL does not compile the water's {' '.join(parts)} shader: {said}"
        ) from None
    gl().glUseProgram(found)
    for name, unit in UNITS.items():
        where = gl().glGetUniformLocation(found, name)
        if where >= 0:
            gl().glUniform1i(where, unit)
    block = gl().glGetUniformBlockIndex(found, "View")
    if block != gl().GL_INVALID_INDEX:
        gl().glUniformBlockBinding(found, block, 0)
    return int(found)


def shrink_of(width: int, height: int) -> int:
    """Pixels of a picture to one of its LIGHT, each way: small pictures have none to spare."""
    return 1 if width * height <= _SMALL else 2


class Texture:
    """A texture, two-dimensional unless it is a cube."""

    def __init__(
        self,
        size: tuple[int, int],
        kind: str,
        *,
        smooth: bool = True,
        repeat: str = "CLAMP_TO_EDGE",
        levels: str = "",
        cube: bool = False,
    ) -> None:
        """Make room.

        Args:
            size: width and height [pixels].
            kind: "RGBA8", "R32F" or "DEPTH32F_STENCIL8".
            smooth: whether it is interpolated between pixels.
            repeat: what is beyond the edges, OpenGL's name.
            levels: how it is interpolated between smaller copies of itself, "LINEAR" or "NEAREST"; "" without.
            cube: whether it has six sides.
        """
        # the wrapped glTexImage2D knows no depth with stencil
        from OpenGL.raw.GL.VERSION.GL_1_1 import glTexImage2D  # type: ignore[import-untyped, unused-ignore]

        g = gl()
        form, part = {
            "RGBA8": (g.GL_RGBA, g.GL_UNSIGNED_BYTE),
            "R32F": (g.GL_RED, g.GL_FLOAT),
            "DEPTH32F_STENCIL8": (g.GL_DEPTH_STENCIL, g.GL_UNSIGNED_INT_24_8),
        }[kind]
        self.size, self.form, self.part = size, form, part
        self.target = g.GL_TEXTURE_CUBE_MAP if cube else g.GL_TEXTURE_2D
        self.name = int(g.glGenTextures(1))
        g.glBindTexture(self.target, self.name)
        for side in range(6 if cube else 1):
            target = g.GL_TEXTURE_CUBE_MAP_POSITIVE_X + side if cube else self.target
            inner = getattr(g, f"GL_{kind}")
            glTexImage2D(target, 0, inner, *size, 0, form, part, None)
        filtering = "LINEAR" if smooth else "NEAREST"
        smaller = f"{filtering}_MIPMAP_{levels}" if levels else filtering
        for key, value in (
            ("MAG_FILTER", filtering), ("MIN_FILTER", smaller), ("WRAP_S", repeat), ("WRAP_T", repeat)
        ):  # fmt: skip
            g.glTexParameteri(
                self.target, getattr(g, f"GL_TEXTURE_{key}"), getattr(g, f"GL_{value}")
            )

    def put(self, values: npt.NDArray[Any], face: int | None = None) -> None:
        """Fill with values, rows from the lower edge; of a cube, one face."""
        gl().glBindTexture(self.target, self.name)
        target = self.target if face is None else gl().GL_TEXTURE_CUBE_MAP_POSITIVE_X + face
        gl().glTexSubImage2D(target, 0, 0, 0, *self.size, self.form, self.part, values)

    def make_levels(self) -> None:
        """Make the smaller copies."""
        gl().glBindTexture(self.target, self.name)
        gl().glGenerateMipmap(self.target)

    def free(self) -> None:
        """Give it back."""
        gl().glDeleteTextures([self.name])


class Target:
    """Textures to draw into."""

    def __init__(
        self, size: tuple[int, int], colours: Mapping[str, str], *, depth: bool = False
    ) -> None:
        """Make them: kinds by names; "distances" are the depth's."""
        g = gl()
        self.size = size
        self.textures = {name: Texture(size, kind) for name, kind in colours.items()}
        outputs = [g.GL_COLOR_ATTACHMENT0 + k for k in range(len(colours))]
        places = dict(zip(self.textures, outputs, strict=True))
        if depth:
            self.textures["distances"] = Texture(size, "DEPTH32F_STENCIL8", smooth=False)
            places["distances"] = g.GL_DEPTH_STENCIL_ATTACHMENT
        self.buffer = int(g.glGenFramebuffers(1))
        g.glBindFramebuffer(g.GL_FRAMEBUFFER, self.buffer)
        for name, texture in self.textures.items():
            g.glFramebufferTexture2D(
                g.GL_FRAMEBUFFER, places[name], g.GL_TEXTURE_2D, texture.name, 0
            )
        g.glDrawBuffers(len(outputs), outputs)
        if g.glCheckFramebufferStatus(g.GL_FRAMEBUFFER) != g.GL_FRAMEBUFFER_COMPLETE:
            raise RenderError("this OpenGL has no frame buffers of the kind that water needs")

    def copy_from(self, other: int) -> None:
        """Take colours and depth of another frame buffer, samples resolved."""
        g = gl()
        g.glBindFramebuffer(g.GL_READ_FRAMEBUFFER, other)
        g.glBindFramebuffer(g.GL_DRAW_FRAMEBUFFER, self.buffer)
        box = (0, 0, *self.size)
        bits = g.GL_COLOR_BUFFER_BIT | g.GL_DEPTH_BUFFER_BIT
        g.glBlitFramebuffer(*box, *box, bits, g.GL_NEAREST)

    def free(self) -> None:
        """Give them back."""
        gl().glDeleteFramebuffers(1, [self.buffer])
        for texture in self.textures.values():
            texture.free()


@contextlib.contextmanager
def own_state() -> Iterator[None]:
    """Inside, OpenGL's settings may be changed: MuJoCo finds its own again."""
    g = gl()
    g.glPushAttrib(g.GL_ALL_ATTRIB_BITS)
    g.glPushClientAttrib(g.GL_CLIENT_ALL_ATTRIB_BITS)
    drawn, read = (
        int(g.glGetIntegerv(name))
        for name in (g.GL_DRAW_FRAMEBUFFER_BINDING, g.GL_READ_FRAMEBUFFER_BINDING)
    )
    try:
        yield
    finally:
        g.glUseProgram(0)
        g.glBindVertexArray(0)
        g.glBindBuffer(g.GL_UNIFORM_BUFFER, 0)
        g.glBindFramebuffer(g.GL_DRAW_FRAMEBUFFER, drawn)
        g.glBindFramebuffer(g.GL_READ_FRAMEBUFFER, read)
        g.glPopClientAttrib()
        g.glPopAttrib()


class WaterPasses:
    """`water.glsl` at work in MuJoCo's own context, for pictures of one size."""

    def __init__(self, size: tuple[int, int]) -> None:
        """Make room for pictures of this width and height."""
        g = gl()
        shrink = shrink_of(*size)
        half = -(-size[0] // shrink), -(-size[1] // shrink)
        self._size = size
        self._columns, self._rows = (-(-side // TILE) for side in size)
        self._programs: dict[str, int] = {}
        self.model = Target(size, {"picture": "RGBA8"}, depth=True)
        self.light = Target(half, {"shape": "R32F", "water": "RGBA8"})
        self.result = Target(size, {"result": "RGBA8"})
        self._far: Target | None = None
        self._vertices = int(g.glGenVertexArrays(1))
        self._view, self._points = (int(name) for name in g.glGenBuffers(2))
        g.glBindBuffer(g.GL_UNIFORM_BUFFER, self._view)
        g.glBufferData(g.GL_UNIFORM_BUFFER, 16 * VIEW_ROWS, None, g.GL_STREAM_DRAW)
        tile = ripples()
        breath = Texture((tile.shape[1], tile.shape[0]), "RGBA8", repeat="REPEAT", levels="NEAREST")
        breath.put(tile)
        breath.make_levels()
        self.inputs: dict[str, Texture] = {"ripples": breath}

    def put_surface(self, surface: ShaderSurface) -> None:
        """Hand heights over."""
        for name in ("heights", "bends", "tallest"):
            values = getattr(surface, name)
            size = values.shape[1], values.shape[0]
            kept = self.inputs.get(name)
            if kept is None or kept.size != size:
                if kept is not None:
                    kept.free()
                smooth = name != "tallest"
                kept = self.inputs[name] = Texture(
                    size, "R32F", smooth=smooth, repeat="CLAMP_TO_BORDER"
                )
            kept.put(values)

    def draw(self, view: SingleArray, tiles: Mapping[str, Flags]) -> None:
        """Draw water into `result` over what `model` holds.

        Args:
            view: (rows, 4), `water.glsl`'s View.
            tiles: (rows, columns) from the lower left: which of them each program draws.
        """
        self._set_view(view)
        for kind, drawn in tiles.items():
            self._fill(kind, self.light if kind.startswith("LIGHT") else self.result, drawn)

    def draw_spray(self, view: SingleArray, drops: SingleArray, sheet: SingleArray) -> None:
        """Draw drops (n, 5) and triangles (m, 4) into `result`, see `mjskip.draw.spray`."""
        g = gl()
        g.glBindFramebuffer(g.GL_DRAW_FRAMEBUFFER, self.result.buffer)
        g.glViewport(0, 0, *self._size)
        g.glDisable(g.GL_DEPTH_TEST)
        g.glDisable(g.GL_CULL_FACE)
        g.glEnable(g.GL_BLEND)
        g.glEnable(g.GL_PROGRAM_POINT_SIZE)
        g.glEnable(g.GL_POINT_SPRITE)  # MuJoCo's context is a compatible one
        g.glBlendFunc(g.GL_SRC_ALPHA, g.GL_ONE_MINUS_SRC_ALPHA)
        g.glBindVertexArray(self._vertices)
        g.glActiveTexture(g.GL_TEXTURE0 + UNITS["distances"])
        g.glBindTexture(g.GL_TEXTURE_2D, self.model.textures["distances"].name)
        rows = dict(zip(("eye", "ahead", "right", "up", "planes"), view, strict=False))
        for kind, values, shape in (
            ("SHEET", sheet, g.GL_TRIANGLES),
            ("DROPS", drops, g.GL_POINTS),
        ):
            if not len(values):
                continue
            made = self._programs.get(kind) or program(kind, spray=True)
            self._programs[kind] = made
            g.glUseProgram(made)
            for name, row in rows.items():
                row = [*row[:3], self._size[1]] if name == "up" else row
                g.glUniform4f(g.glGetUniformLocation(made, name), *map(float, row))
            g.glUniform2f(g.glGetUniformLocation(made, "size"), *map(float, self._size))
            g.glBindBuffer(g.GL_ARRAY_BUFFER, self._points)
            g.glBufferData(g.GL_ARRAY_BUFFER, values.nbytes, values, g.GL_STREAM_DRAW)
            for place, first, count in ((0, 0, 4), (1, 3, 2)):
                wide = values.shape[1]
                g.glEnableVertexAttribArray(place)
                g.glVertexAttribPointer(
                    place, min(count, wide - first), g.GL_FLOAT, False, 4 * wide,
                    ctypes.c_void_p(4 * first),
                )  # fmt: skip
            g.glDrawArrays(shape, 0, len(values))
        g.glBindBuffer(g.GL_ARRAY_BUFFER, 0)

    def read(self, out: Image) -> None:
        """Take the picture (height, width, 3), rows from the top."""
        self._read(self.result, gl().GL_RGB, gl().GL_UNSIGNED_BYTE, out)

    def distances(self, view: SingleArray) -> SingleArray:
        """How far ahead the water is (height, width) [m], rows from the top; -1 where it is hidden."""
        if self._far is None:
            self._far = Target(self._size, {"far": "R32F"})
        self._set_view(view)
        self._fill("DISTANCE WAVES", self._far)
        found = np.empty(self._size[::-1], np.float32)
        self._read(self._far, gl().GL_RED, gl().GL_FLOAT, found)
        return found

    def converted(
        self, kind: str, depths: Texture, side: int, view: SingleArray | None = None
    ) -> tuple[Texture, SingleArray]:
        """A depth buffer through a program of that kind: as a texture (side, side), and its numbers."""
        found = np.empty((side, side), np.float32)
        with own_state():
            if view is not None:
                self._set_view(view)
            target = Target((side, side), {"found": "R32F"})
            self._fill(kind, target, textures={"distances": depths})
            self._read(target, gl().GL_RED, gl().GL_FLOAT, found)
        texture = target.textures.pop("found")
        target.free()
        return texture, found

    def adopt(self, buffer: int) -> None:
        """Let another frame buffer, of one sample a pixel, draw into `model`: nothing need be copied."""
        g = gl()
        g.glBindFramebuffer(g.GL_FRAMEBUFFER, buffer)
        for place, name in (
            (g.GL_COLOR_ATTACHMENT0, "picture"), (g.GL_DEPTH_STENCIL_ATTACHMENT, "distances")
        ):  # fmt: skip
            texture = self.model.textures[name]
            g.glFramebufferTexture2D(g.GL_FRAMEBUFFER, place, texture.target, texture.name, 0)

    def free(self) -> None:
        """Give everything back."""
        g = gl()
        for target in (self.model, self.light, self.result, self._far):
            if target is not None:
                target.free()
        for texture in self.inputs.values():
            texture.free()
        for made in self._programs.values():
            g.glDeleteProgram(made)
        g.glDeleteVertexArrays(1, [self._vertices])
        g.glDeleteBuffers(2, [self._view, self._points])

    def _program(self, kind: str) -> int:
        """Parts of `water.glsl`, compiled when they are first needed."""
        if kind not in self._programs:
            flipped = ["FLIPPED"] if kind.split()[0] in _FLIPPED else []
            made = self._programs[kind] = program(*kind.split(), *flipped)
            place = gl().glGetUniformLocation(made, "tiles")
            gl().glUniform3i(place, *self._size, self._columns)
        return self._programs[kind]

    def _set_view(self, view: SingleArray) -> None:
        g = gl()
        g.glBindBuffer(g.GL_UNIFORM_BUFFER, self._view)
        g.glBufferSubData(g.GL_UNIFORM_BUFFER, 0, view.nbytes, view)
        g.glBindBufferBase(g.GL_UNIFORM_BUFFER, 0, self._view)

    def _fill(
        self,
        kind: str,
        target: Target,
        tiles: Flags | None = None,
        textures: Mapping[str, Texture] | None = None,
    ) -> None:
        """Draw tiles of a target by one program; all of them if None."""
        g = gl()
        if tiles is None:
            tiles = np.ones(self._columns * self._rows, np.bool_)
        first = np.flatnonzero(tiles).astype(np.int32) * 6
        if not len(first):
            return
        g.glBindFramebuffer(g.GL_DRAW_FRAMEBUFFER, target.buffer)
        g.glViewport(0, 0, *target.size)
        for setting in (
            g.GL_DEPTH_TEST, g.GL_BLEND, g.GL_CULL_FACE, g.GL_SCISSOR_TEST, g.GL_STENCIL_TEST
        ):  # fmt: skip
            g.glDisable(setting)
        g.glUseProgram(self._program(kind))
        if textures is None:
            textures = {**self.inputs, **self.model.textures}
            if target is not self.light:
                textures |= self.light.textures
        for name, texture in textures.items():
            if name in UNITS:
                g.glActiveTexture(g.GL_TEXTURE0 + UNITS[name])
                g.glBindTexture(texture.target, texture.name)
        g.glBindVertexArray(self._vertices)
        g.glMultiDrawArrays(g.GL_TRIANGLES, first, np.full_like(first, 6), len(first))

    @staticmethod
    def _read(target: Target, form: Any, part: Any, out: npt.NDArray[Any]) -> None:
        g = gl()
        g.glBindFramebuffer(g.GL_READ_FRAMEBUFFER, target.buffer)
        g.glReadBuffer(g.GL_COLOR_ATTACHMENT0)
        g.glPixelStorei(g.GL_PACK_ALIGNMENT, 1)
        g.glReadPixels(0, 0, *target.size, form, part, out)
