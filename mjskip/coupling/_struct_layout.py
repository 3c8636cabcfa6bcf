"""Where MuJoCo's structs keep their members: from its own introspection, checked against live memory.

Native code that is handed `mjModel*` and `mjData*` needs the offset of every member it reads. They are
worked out by C's rules from the declarations that `mujoco.introspect` carries, and then compared with
the addresses of the arrays that MuJoCo's own bindings show for a small model.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from mujoco.introspect import ast_nodes
from mujoco.introspect.structs import STRUCTS

from mjskip._typing import Array
from mjskip.errors import MjskipError

library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
"""The shared object that MuJoCo's bindings have already loaded."""

DTYPES: dict[str, Any] = {
    "mjtNum": np.float64,
    "mjtSize": np.int64,
    "uint64_t": np.uint64,
    "size_t": np.uint64,
    "uintptr_t": np.uint64,
    "float": np.float32,
    "int": np.int32,
    "char": np.uint8,
    "mjtByte": np.uint8,
    "mjtBool": np.uint8,
}
POINTER = 8
MEDIUM = ("density", "viscosity")


@dataclass(frozen=True, kw_only=True)
class Member:
    """A member of a C struct.

    Attributes:
        offset: from the struct's beginning [bytes].
        kind: C type of the value, or of what the pointer points to.
        extent: shape of the array a pointer points to, numbers or names of sizes; None for a value.
    """

    offset: int
    kind: str
    extent: tuple[str | int, ...] | None


@cache
def members(struct: str) -> dict[str, Member]:
    """Members of one of MuJoCo's structs, by name."""
    found, _, _ = _lay_out(STRUCTS[struct].fields)
    return found


def _lay_out(fields: Any) -> tuple[dict[str, Member], int, int]:
    """Members, size and alignment of a struct, by C's rules."""
    found: dict[str, Member] = {}
    end, widest = 0, 1
    for item in fields:
        size, align = _measure(item.type)
        offset = -(-end // align) * align
        pointer = isinstance(item.type, ast_nodes.PointerType)
        inner = item.type.inner_type if pointer else item.type
        found[item.name] = Member(
            offset=offset,
            kind=str(inner).removeprefix("const "),
            extent=item.array_extent if pointer else None,
        )
        end, widest = offset + size, max(widest, align)
    return found, -(-end // widest) * widest, widest


def _measure(kind: Any) -> tuple[int, int]:
    """Size and alignment of a C type [bytes]."""
    match kind:
        case ast_nodes.PointerType():
            return POINTER, POINTER
        case ast_nodes.ArrayType():
            size, align = _measure(kind.inner_type)
            return size * int(np.prod(kind.extents)), align
        case ast_nodes.AnonymousStructDecl():
            return _lay_out(kind.fields)[1:]
        case ast_nodes.ValueType() if kind.name in DTYPES:
            size = np.dtype(DTYPES[kind.name]).itemsize
            return size, size
        case ast_nodes.ValueType() if kind.name in STRUCTS:
            return _lay_out(STRUCTS[kind.name].fields)[1:]
    return 4, 4  # an enum


def size_of(struct: str) -> int:
    """Size of one of MuJoCo's structs [bytes]."""
    return _lay_out(STRUCTS[struct].fields)[1]


def option_offset(name: str) -> int:
    """Where in mjModel its options have a member [bytes]."""
    return members("mjModel")["opt"].offset + members("mjOption")[name].offset


class ModelView:
    """A model at an address, its members as arrays without a copy: `MjModel` for reading, as it were."""

    def __init__(self, address: int) -> None:
        self._address = address
        self._seen: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        if name not in self._seen:
            self._seen[name] = self._read(name)
        return self._seen[name]

    def _read(self, name: str) -> Any:
        if name not in members("mjModel"):
            raise AttributeError(f"mjModel has no member {name!r}")
        member = members("mjModel")[name]
        address = self._address + member.offset
        if member.extent is None:
            return _array(address, member.kind, (1,))[0]
        shape = tuple(n if isinstance(n, int) else int(getattr(self, n)) for n in member.extent)
        return _array(ctypes.c_uint64.from_address(address).value, member.kind, shape)

    @property
    def gravity(self) -> Array:
        """`MjModel.opt.gravity` (3,) [m/s^2]."""
        return _array(self._address + option_offset("gravity"), "mjtNum", (3,))

    @property
    def medium(self) -> tuple[float, float]:
        """Density and viscosity of MuJoCo's own medium."""
        found = [_array(self._address + option_offset(n), "mjtNum", (1,))[0] for n in MEDIUM]
        return float(found[0]), float(found[1])

    @property
    def disabled(self) -> int:
        """`MjModel.opt.disableflags`."""
        return int(_array(self._address + option_offset("disableflags"), "int", (1,))[0])

    def body(self, body: int) -> SimpleNamespace:
        """Name of a body, as `MjModel.body` has it."""
        return self._named(self.name_bodyadr[body])

    def geom(self, geom: int) -> SimpleNamespace:
        """Name of a geom, as `MjModel.geom` has it."""
        return self._named(self.name_geomadr[geom])

    def plugin_instance(self, instance: int) -> SimpleNamespace:
        """Name of a plugin instance and the texts of its configuration, in the order of its keys."""
        texts = bytes(self.plugin_attr[self.plugin_attradr[instance] :]).split(b"\0")
        named = self._named(self.name_pluginadr[instance])
        return SimpleNamespace(name=named.name, texts=[text.decode() for text in texts])

    def _named(self, at: int) -> SimpleNamespace:
        return SimpleNamespace(name=bytes(self.names[at:]).split(b"\0", 1)[0].decode())


def _array(address: int, kind: str, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    dtype = np.dtype(DTYPES[kind])
    size = dtype.itemsize * int(np.prod(shape))
    if size == 0:
        return np.empty(shape, dtype)
    memory = (ctypes.c_char * size).from_address(address)
    return np.frombuffer(memory, dtype).reshape(shape)


PROBE = """
<mujoco>
  <asset><mesh name="m" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
  <worldbody>
    <body name="arm"><joint name="j"/><geom size=".1"/>
      <body pos="1 0 0"><joint axis="1 0 0"/><geom type="mesh" mesh="m"/></body>
    </body>
    <body name="free"><freejoint/><geom size=".1"/></body>
  </worldbody>
  <actuator><motor joint="j"/></actuator>
  <sensor><jointpos joint="j"/></sensor>
  <custom><numeric name="n" data="1"/><text name="t" data="t"/></custom>
  <keyframe><key name="k"/></keyframe>
</mujoco>
"""


def check(data_members: Iterable[str]) -> None:
    """Compare the layout with a live model, and with these members of its data.

    Of mjData only named members are looked at: some of the others are not there before they are needed.

    Raises:
        MjskipError: a member is not where the layout has it; names MuJoCo's version.
    """
    model = mujoco.MjModel.from_xml_string(PROBE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    wrong = [f"mjModel.{name}" for name in _misplaced("mjModel", model, members("mjModel"))]
    wrong += [f"mjData.{name}" for name in _misplaced("mjData", data, data_members)]
    if not np.array_equal(ModelView(model._address).gravity, model.opt.gravity):
        wrong.append("mjOption.gravity")
    at = model._address + option_offset("timestep")
    if _array(at, "mjtNum", (1,))[0] != model.opt.timestep:
        wrong.append("mjOption.timestep")
    if wrong:
        raise MjskipError(
            f"MuJoCo {mujoco.mj_versionString()} keeps {', '.join(wrong[:3])} elsewhere than its "
            "introspection says, so compiled water cannot run with it: use mjskip.attach(native=False), "
            "which does not depend on it"
        )


def _misplaced(struct: str, owner: Any, names: Iterable[str]) -> list[str]:
    """Members of a live struct that are not at their offset; those of no size cannot be told."""
    wrong = []
    for name in names:
        member = members(struct)[name]
        shown = getattr(owner, name, None)
        at = owner._address + member.offset
        if isinstance(shown, np.ndarray) and shown.size and member.extent is not None:
            if ctypes.c_uint64.from_address(at).value != shown.ctypes.data:
                wrong.append(name)
        elif (
            isinstance(shown, int | float)
            and member.kind in DTYPES
            and _array(at, member.kind, (1,))[0] != shown
        ):
            wrong.append(name)
    return wrong
