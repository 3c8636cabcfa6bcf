"""Wet bodies of a model as hulls: the one registry that `attach` and the plugin share.

A hull is found by the content it is made of, so equal bodies share it, and attaching again costs nothing.
"""

from __future__ import annotations

import hashlib
import threading
import warnings
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_choice, check_count, check_switch, fault
from mjskip.coupling.bodies import body_name, geom_solid, kind_name, label, mesh_of, pose_in
from mjskip.coupling.selection import GeomRule, WetBody, geom_rule, members_of, wet_body
from mjskip.errors import MeshError, MjskipWarning, SceneError
from mjskip.hydro import primitives
from mjskip.hydro.hull import Hull
from mjskip.hydro.stone import Stone
from mjskip.rigid.attitude import matrices

if TYPE_CHECKING:
    from mjskip.hydro.solids import Simplification

Interior = Literal["flooded", "deck", "convex"]
INTERIORS: tuple[Interior, ...] = get_args(Interior)

MIN_FACES = 12
MAX_FACES = 1000
"""Faces of a hull above which it is simplified unless told otherwise."""


@dataclass(frozen=True, kw_only=True)
class HullOptions:
    """How geoms become a hull.

    Attributes:
        resolution: segments around a round geom.
        max_faces: a hull of more faces is simplified to this many; 0 keeps all.
        interior: what fills an open boat. "flooded": water. "deck": nothing, its basins are closed at their
            lowest rim and its open meshes across their edge. "convex": nothing, it is its convex hull.
        strict: refuse open meshes; otherwise their convex hull is taken, with one warning each.

    Raises:
        ValueError: a value is out of range.
    """

    resolution: int = primitives.RESOLUTION
    max_faces: int = MAX_FACES
    interior: Interior = "flooded"
    strict: bool = False

    def __post_init__(self) -> None:
        check_count("resolution", self.resolution, low=4, high=primitives.MAX_SEGMENTS)
        if check_count("max_faces", self.max_faces, low=0, high=2**31) in range(1, MIN_FACES):
            raise fault("max_faces", self.max_faces, f"give at least {MIN_FACES}, or 0 for all")
        check_choice("interior", self.interior, INTERIORS)
        check_switch("strict", self.strict)


@dataclass(frozen=True, kw_only=True, eq=False)
class BuiltHull:
    """A hull as the registry keeps it.

    Attributes:
        hull: about the centre of mass of its bodies, axes of the body that the force acts on.
        simplification: what a face budget cost; None if nothing was left out.
        lost: why single geoms could not be wet, by place among the geoms.
        warnings: what was said when it was built.
    """

    hull: Hull | None
    simplification: Simplification | None = None
    lost: Mapping[int, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


class Registry:
    """Hulls by content; the least recently used go when they fill the memory that is set aside."""

    KEPT_BYTES = 2**26

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._built: OrderedDict[bytes, BuiltHull] = OrderedDict()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._built)

    def find(self, key: bytes) -> BuiltHull | None:
        """What was built of a content."""
        with self._lock:
            found = self._built.get(key)
            if found is not None:
                self._built.move_to_end(key)
            return found

    def keep(self, key: bytes, built: BuiltHull) -> None:
        """Remember what was built."""
        with self._lock:
            self._built[key] = built
            self._bytes += _size(built)
            while self._bytes > self.KEPT_BYTES and len(self._built) > 1:
                self._bytes -= _size(self._built.popitem(last=False)[1])


def _size(built: BuiltHull) -> int:
    return 1000 if built.hull is None else 1000 + 300 * len(built.hull.faces)


registry = Registry()


@dataclass(frozen=True, kw_only=True)
class Inertia:
    """Mass properties of a rigid part.

    Attributes:
        mass: [kg].
        centre: of mass (3,) [m].
        tensor: about it (3, 3) [kg m^2], axes of the body.
    """

    mass: float
    centre: Array
    tensor: Array


def inertia_of(model: Any, head: int, members: tuple[int, ...]) -> Inertia:
    """Mass properties of bodies that are welded to one, in its frame; the body's own frame if it is massless."""
    axes = matrices(np.asarray(model.body_iquat[head], np.float64))
    if len(members) == 1 or not any(model.body_mass[m] > 0.0 for m in members[1:]):
        return Inertia(
            mass=float(model.body_mass[head]),
            centre=np.array(model.body_ipos[head], np.float64),
            tensor=axes @ np.diag(model.body_inertia[head]) @ axes.T,
        )
    masses, centres, tensors = [], [], []
    for member in members:
        position, rotation = pose_in(model, member, head)
        turn = rotation @ matrices(np.asarray(model.body_iquat[member], np.float64))
        masses.append(float(model.body_mass[member]))
        centres.append(position + rotation @ np.asarray(model.body_ipos[member], np.float64))
        tensors.append(turn @ np.diag(model.body_inertia[member]) @ turn.T)
    mass = sum(masses)
    centre = np.asarray(sum(m * c for m, c in zip(masses, centres, strict=True)) / mass)
    tensor = np.zeros((3, 3))
    for m, c, own in zip(masses, centres, tensors, strict=True):
        r = c - centre
        tensor += own + m * (r @ r * np.eye(3) - np.outer(r, r))
    return Inertia(mass=mass, centre=centre, tensor=tensor)


def centre_of_mass(model: Any, body: int) -> Array:
    """Centre of mass (3,) of a body and those welded to it, in its frame [m]."""
    return inertia_of(model, body, members_of(model, body)).centre


def hull_of(model: Any, wet: WetBody, options: HullOptions, inertia: Inertia) -> BuiltHull:
    """The hull of a wet body, from the registry or built; what it has to say is said as warnings.

    Raises:
        MeshError: a mesh is open (strict).
    """
    placed = [_placed(model, wet.body, geom, inertia.centre) for geom in wet.geoms]
    key = _content(model, wet, options, inertia, placed)
    built = registry.find(key)
    if built is None:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", MjskipWarning)
            built = _build(model, wet, options, inertia, placed)
        built = BuiltHull(
            hull=built.hull,
            simplification=built.simplification,
            lost=built.lost,
            warnings=tuple(str(w.message) for w in caught if w.category is MjskipWarning),
        )
        registry.keep(key, built)
    for text in built.warnings:
        warnings.warn(text, MjskipWarning, stacklevel=4)
    return built


def _placed(model: Any, head: int, geom: int, centre: Array) -> tuple[Array, Array]:
    """Position (3,) from the centre of mass and rotation (3, 3) of a geom, axes of a body."""
    position, rotation = pose_in(model, int(model.geom_bodyid[geom]), head)
    turn = matrices(np.asarray(model.geom_quat[geom], np.float64))
    place = position + rotation @ np.asarray(model.geom_pos[geom], np.float64)
    return place - centre, rotation @ turn


def _content(
    model: Any,
    wet: WetBody,
    options: HullOptions,
    inertia: Inertia,
    placed: list[tuple[Array, Array]],
) -> bytes:
    """A digest of all that a hull is made of, and of the names that its warnings use."""
    digest = hashlib.blake2b(repr(options).encode(), digest_size=16)
    digest.update(inertia.tensor.tobytes())
    for geom, (place, turn) in zip(wet.geoms, placed, strict=True):
        digest.update(place.tobytes() + turn.tobytes())
        digest.update(np.asarray(model.geom_size[geom], np.float64).tobytes())
        digest.update(bytes([int(model.geom_type[geom])]))
        if kind_name(model, geom) == "mesh":
            mesh = mesh_of(model, geom)
            digest.update(np.ascontiguousarray(mesh.vertices).tobytes())
            digest.update(np.ascontiguousarray(mesh.faces).tobytes())
            digest.update(label(model, geom).encode())
    return digest.digest()


def _build(
    model: Any,
    wet: WetBody,
    options: HullOptions,
    inertia: Inertia,
    placed: list[tuple[Array, Array]],
) -> BuiltHull:
    import trimesh

    from mjskip.hydro.solids import convex_hull, decked, simplify, union, with_area

    parts: list[Any] = []
    lost: dict[int, str] = {}
    for k, (geom, (place, turn)) in enumerate(zip(wet.geoms, placed, strict=True)):
        try:
            solid = geom_solid(
                model,
                geom,
                resolution=options.resolution,
                strict=options.strict,
                deck=options.interior == "deck",
            )
        except MeshError as error:
            if options.strict:
                raise
            lost[k] = f"is no solid: {str(error).split(': ', 1)[-1]}"
            warnings.warn(f"{error}; it is left out", MjskipWarning, stacklevel=2)
            continue
        parts.append(
            trimesh.Trimesh(np.asarray(solid.vertices) @ turn.T + place, solid.faces, process=False)
        )
    if not parts:
        return BuiltHull(hull=None, lost=lost)
    try:
        whole = union(parts)
    except MeshError as error:
        if options.strict:
            raise
        return BuiltHull(hull=None, lost=dict.fromkeys(range(len(placed)), f"is no solid: {error}"))
    if options.interior == "convex":
        whole = convex_hull(whole.vertices)
    elif options.interior == "deck":
        whole = decked(whole)
    simplification = None
    if options.max_faces and len(whole.faces) > options.max_faces:
        whole, simplification = simplify(whole, options.max_faces)
        if len(whole.faces) > options.max_faces:
            warnings.warn(
                f"the hull of body {body_name(model, wet.body)!r} keeps {len(whole.faces)} faces: fewer, up to "
                f"max_faces={options.max_faces}, would spoil its volume or area; choose simpler geoms with geoms=, or "
                'interior="convex"',
                MjskipWarning,
                stacklevel=2,
            )
    vertices = np.asarray(whole.vertices, np.float64)
    faces = np.asarray(whole.faces, np.int32)
    tensor = inertia.tensor
    if not tensor.any():  # a massless body: its disc is that of its shape
        tensor = np.asarray(whole.moment_inertia, np.float64)
    hull = Hull.of_surface(vertices=vertices, faces=with_area(vertices, faces), inertia=tensor)
    return BuiltHull(hull=hull, simplification=simplification, lost=lost)


THROWN_OPTIONS = HullOptions(max_faces=0)
"""What is thrown keeps every face."""


def body_stone(
    model: Any, body: int, *, options: HullOptions = THROWN_OPTIONS, geoms: GeomRule = None
) -> Stone:
    """The stone that a body is: MuJoCo's mass and inertia, and its hull; see `attach` for geoms.

    Raises:
        SceneError: the body has no geom for water to act on, or no mass.
        MeshError: a mesh has no volume.
    """
    wet = wet_body(model, body, geom_rule(model, geoms, members_of(model, body)))
    name = body_name(model, body)
    inertia = inertia_of(model, body, wet.members)
    if not inertia.mass > 0.0:
        raise SceneError(f"body {name!r} has no mass: give its geoms a density or a mass")
    built = hull_of(model, wet, options, inertia)
    if built.hull is None:
        reasons = [*wet.left_out.values(), *built.lost.values()]
        raise SceneError(
            f"body {name!r} has no geom for water to act on: {'; '.join(reasons) or 'it has none'}"
        )
    hull = built.hull
    return Stone(
        vertices=hull.vertices,
        faces=hull.faces,
        disc_normal=hull.disc_normal,
        disc_area=hull.disc_area,
        disc_centre=hull.disc_centre,
        mass=inertia.mass,
        inertia=inertia.tensor,
    )
