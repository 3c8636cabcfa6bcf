"""Closed surfaces: known to be closed, without enclosed voids, united, and of few faces.

A surface is *closed* if every directed edge of its triangles has its reverse: then its volume is defined,
also where parts touch along an edge that four triangles share.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import manifold3d
import numpy as np
import numpy.typing as npt
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import QhullError

from mjskip._typing import Array
from mjskip.errors import MeshError, MjskipWarning

Faces = npt.NDArray[np.int32]

FLAT = 1e-14
"""Triangles of less area than this times the square of the extent carry no load."""

NO_VOLUME = 1e-9
"""Surfaces of less volume than this times the cube of the extent are no solids."""

WELD = 1e-6
"""Vertices nearer than this times the extent are one, where that closes a mesh."""


def closed_mesh(
    mesh: Any,
    *,
    scale: float = 1.0,
    fix_normals: bool = False,
    strict: bool = True,
    what: str = "the mesh",
) -> Any:
    """A welded copy in metres, known to be closed, outward and solid.

    Triangles without area stay: they keep it closed; see `with_area`.

    Args:
        mesh: a `trimesh.Trimesh`.
        scale: factor from its length unit to metres.
        fix_normals: turn triangles so that normals point outwards, those of cavities into the cavity.
        strict: refuse an open mesh; otherwise its convex hull is taken, with a warning.
        what: how that warning names the mesh.

    Raises:
        MeshError: with what is wrong and what to do.
    """
    if len(mesh.faces) == 0:
        raise MeshError("the mesh has no triangles: a body in water needs a closed surface")
    if not np.isfinite(mesh.vertices).all():  # welding would drop them without a word
        raise MeshError("the mesh has vertices that are not finite: repair it first")
    mesh = trimesh.Trimesh(np.asarray(mesh.vertices) * scale, mesh.faces, process=True)
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    mesh = _welded(mesh, extent)
    open_edges = count_open_edges(mesh.faces)
    if open_edges == 0 and fix_normals:
        mesh = turned_outward(mesh)
    if open_edges == 0 and not _is_wound_consistently(mesh.faces):
        if fix_normals:  # a surface with one side, such as Klein's bottle
            open_edges = -1
        else:
            raise MeshError(
                "some triangles of the mesh face inwards: pass fix_normals=True to turn them"
            )
    if open_edges:
        mesh = _closed_by_convex_hull(mesh, open_edges, strict=strict, what=what)
    with np.errstate(all="ignore"):  # trimesh divides by it
        volume = float(mesh.volume)
    if abs(volume) <= NO_VOLUME * extent**3:
        raise MeshError(
            f"the mesh has no volume ({volume:.3g} m^3): give it a thickness, a stone must be solid"
        )
    if volume < 0.0:
        raise MeshError("the normals of the mesh point inwards: pass fix_normals=True to turn them")
    return mesh


def with_area(vertices: Array, faces: Faces) -> Faces:
    """The triangles that have an area: others carry no load and have no normal, but keep a surface closed."""
    a, b, c = np.moveaxis(np.asarray(vertices)[faces], 1, 0)
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    kept: Faces = faces[areas > FLAT * float(np.ptp(vertices, axis=0).max()) ** 2]
    return kept


def count_open_edges(faces: npt.NDArray[Any]) -> int:
    """Edges that an odd number of triangles share: none for a closed surface, whichever way it is wound."""
    edges = np.sort(np.asarray(faces)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, counts = np.unique(edges, axis=0, return_counts=True)
    return int(np.sum(counts % 2))


def _is_wound_consistently(faces: npt.NDArray[Any]) -> bool:
    """Whether every directed edge has its reverse."""
    edges = np.asarray(faces)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = edges[edges[:, 0] != edges[:, 1]]
    forward = edges[:, 0] < edges[:, 1]
    _, where = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    balance = np.bincount(where.ravel(), weights=np.where(forward, 1.0, -1.0))
    return not balance.any()


def is_closed(mesh: Any) -> bool:
    """Whether the volume of a surface is defined."""
    return _is_wound_consistently(mesh.faces)


def _welded(mesh: Any, extent: float) -> Any:
    """The mesh without collapsed triangles; cracks of less than `WELD` of its extent are closed."""
    if count_open_edges(mesh.faces):
        near = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        near.merge_vertices(digits_vertex=max(0, -int(np.floor(np.log10(WELD * extent)))))
        if count_open_edges(near.faces) == 0:
            mesh = near
    a, b, c = np.asarray(mesh.faces).T
    collapsed = (a == b) | (b == c) | (c == a)
    if collapsed.any():
        mesh.update_faces(~collapsed)
    return mesh


def _closed_by_convex_hull(mesh: Any, open_edges: int, *, strict: bool, what: str) -> Any:
    """The convex hull of an open mesh, said once.

    Raises:
        MeshError: strict, or the mesh is flat.
    """
    fault = (
        f"is open ({open_edges} edges with one triangle only)"
        if open_edges > 0
        else "has one side only"
    )
    hull = convex_hull(mesh.vertices)
    if strict:
        raise MeshError(
            f"the mesh {fault}: close it in a modeller, or give its convex hull, mesh.convex_hull"
        )
    warnings.warn(
        f"{what} {fault}: its convex hull of {hull.volume:.4g} m^3 is taken instead; close the mesh if it is "
        "not convex",
        MjskipWarning,
        stacklevel=4,
    )
    return hull


def convex_hull(points: npt.ArrayLike) -> Any:
    """Convex hull of points (n, 3).

    Raises:
        MeshError: they lie in a plane.
    """
    points = np.asarray(points, np.float64)
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            hull = trimesh.convex.convex_hull(points)
    except (QhullError, ValueError, IndexError):
        hull = None
    if hull is None or not abs(hull.volume) > NO_VOLUME * extent**3:
        raise MeshError(NO_THICKNESS)
    return hull


NO_THICKNESS = "the mesh is flat, it has no volume: give it a thickness"


def components(mesh: Any) -> list[Any]:
    """The parts of a surface, each connected by edges of two triangles."""
    labels = _labels(mesh)
    if labels.max(initial=0) == 0:
        return [mesh]
    parts = []
    for label in range(int(labels.max()) + 1):
        part = trimesh.Trimesh(mesh.vertices, mesh.faces[labels == label], process=False)
        part.remove_unreferenced_vertices()
        parts.append(part)
    return parts


def _labels(mesh: Any) -> npt.NDArray[np.int32]:
    """Number of the part (m,) that every triangle belongs to."""
    count = len(mesh.faces)
    a, b = np.asarray(mesh.face_adjacency).reshape(-1, 2).T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int32)


def turned_outward(mesh: Any) -> Any:
    """A copy whose parts are wound consistently: outwards, and into the cavity where one is inside another."""
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    trimesh.repair.fix_winding(mesh)
    labels = _labels(mesh)
    parts = [np.flatnonzero(labels == k) for k in range(int(labels.max()) + 1)]
    corners = [np.asarray(mesh.triangles)[rows] for rows in parts]
    faces = np.array(mesh.faces)
    for k, rows in enumerate(parts):
        depth = sum(_encloses(corners[j], corners[k]) for j in range(len(parts)) if j != k)
        if (_signed_volume(corners[k]) < 0.0) != (depth % 2 == 1):
            faces[rows] = faces[rows][:, ::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def _signed_volume(triangles: Array) -> float:
    a, b, c = np.moveaxis(triangles - triangles[0, 0], 1, 0)
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0)


def _encloses(outer: Array, inner: Array) -> bool:
    """Whether all of one closed surface lies inside another: winding numbers of a sample of corners."""
    low, high = outer.min(axis=(0, 1)), outer.max(axis=(0, 1))
    points = inner.reshape(-1, 3)
    if not ((points >= low) & (points <= high)).all():
        return False
    for point in points[:: max(1, len(points) // 40)]:
        a, b, c = np.moveaxis(outer - point, 1, 0)
        la, lb, lc = (np.linalg.norm(e, axis=1) for e in (a, b, c))
        top = np.einsum("ni,ni->n", a, np.cross(b, c))
        bottom = (
            la * lb * lc
            + np.einsum("ni,ni->n", a, b) * lc
            + np.einsum("ni,ni->n", b, c) * la
            + np.einsum("ni,ni->n", c, a) * lb
        )
        if abs(np.arctan2(top, bottom).sum()) < np.pi:  # half of a winding number of one
            return False
    return True


def without_voids(mesh: Any) -> Any:
    """The outside of a closed surface: parts that water cannot reach are left out.

    A part that is wound the other way bounds a void; solids within a void are left out by `union`.
    """
    parts = components(mesh)
    if len(parts) == 1:
        return mesh
    solid = [part for part in parts if _signed_volume(np.asarray(part.triangles)) > 0.0]
    if len(solid) == len(parts):
        return mesh
    return solid[0] if len(solid) == 1 else trimesh.util.concatenate(solid)


def union(parts: Sequence[Any]) -> Any:
    """The union of closed surfaces, without enclosed voids.

    A single part of one piece is handed back as it is. Flat pieces displace nothing and are left out.

    Raises:
        MeshError: a part is not closed, or all are flat.
    """
    pieces = [piece for part in parts for piece in components(without_voids(part))]
    if len(pieces) == 1:
        return pieces[0]
    extent = max(float(np.ptp(piece.vertices, axis=0).max()) for piece in pieces)
    while True:
        solids = [solid for piece in pieces if (solid := _manifold_or_hull(piece)) is not None]
        if not solids:
            raise MeshError(NO_THICKNESS)
        whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
        mesh = _surface(whole, extent)
        outside = without_voids(mesh)
        if len(outside.faces) == len(mesh.faces):
            return mesh
        pieces = components(outside)
        if len(pieces) == 1:
            return pieces[0]


def intersection_volume(a: Any, b: Any) -> float:
    """Volume that two closed surfaces share [m^3]."""
    low = np.maximum(a.bounds[0], b.bounds[0])
    if (low >= np.minimum(a.bounds[1], b.bounds[1])).any():
        return 0.0
    return float((_manifold(a) ^ _manifold(b)).volume())


def _manifold_or_hull(mesh: Any) -> Any:
    """A solid of a closed surface; its convex hull, with a warning, where triangles share edges beyond repair.

    None if that is flat.
    """
    try:
        return _manifold(mesh)
    except MeshError:
        try:
            hull = convex_hull(mesh.vertices)
        except MeshError:
            return None
        warnings.warn(
            f"a part of {mesh.volume:.4g} m^3 is closed, but no manifold: its convex hull is taken instead",
            MjskipWarning,
            stacklevel=4,
        )
        return _manifold(hull)


def _manifold(mesh: Any) -> Any:
    solid = manifold3d.Manifold(
        manifold3d.Mesh64(
            vert_properties=np.array(mesh.vertices, np.float64, order="C"),
            tri_verts=np.array(mesh.faces, np.uint64, order="C"),
        )
    )
    if solid.status() == manifold3d.Error.NoError and not solid.is_empty():
        return solid
    parts = components(mesh)
    if len(parts) > 1:
        return manifold3d.Manifold.batch_boolean(
            [_manifold(part) for part in parts], manifold3d.OpType.Add
        )
    raise MeshError(f"the mesh is no closed surface ({solid.status().name}): give its convex hull")


def _surface(solid: Any, extent: float) -> Any:
    """The triangles of a manifold, slivers collapsed."""
    shown = solid.simplify(1e-9 * extent).to_mesh64()
    return trimesh.Trimesh(
        np.array(shown.vert_properties, np.float64)[:, :3].copy(),
        np.array(shown.tri_verts, np.int64),
        process=False,
    )


@dataclass(frozen=True, kw_only=True)
class Simplification:
    """What a face budget cost.

    Attributes:
        faces_before: triangles of the surface as it was given.
        volume_error: relative, before the volume was put right by scaling.
        area_error: relative error of the area that remains.
    """

    faces_before: int
    volume_error: float
    area_error: float


AGGRESSIVE = (7.0, 3.0)
"""Rates at which fast-simplification's threshold grows; the lower is the more careful."""

TOLERANCES = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""Of manifold3d's collapse of edges, in extents."""

MAX_VOLUME_ERROR, MAX_AREA_ERROR = 0.1, 0.1
"""Relative errors beyond which a simpler surface is not taken: of volume, and of area once that is put right."""


def simplify(mesh: Any, max_faces: int) -> tuple[Any, Simplification]:
    """A closed surface of the same volume and of at most some triangles, or the fewest that keep its shape.

    Edges are collapsed by the quadric error (Garland & Heckbert 1997, fast-simplification); where that opens
    the surface or spoils its volume or area, within a tolerance by manifold3d, which keeps it closed. Then the surface
    is scaled about the centroid of its volume.
    """
    size = float(np.ptp(mesh.vertices, axis=0).max())
    small = mesh
    for rate in AGGRESSIVE:
        found = _collapsed(mesh, size, max_faces, rate)
        if len(found.faces) <= max_faces and _keeps_shape(found, mesh):
            small = found
            break
    else:
        solid = _manifold_or_hull(mesh)
        for tolerance in TOLERANCES if solid is not None else ():
            found = _surface(solid.simplify(tolerance * size), 0.0)
            if not _keeps_shape(found, mesh):
                break
            small = found
            if len(small.faces) <= max_faces:
                break
        if len(small.faces) > max_faces:
            found = _collapsed(small, size, max_faces, 1.0)
            small = found if _keeps_shape(found, mesh) else small
    volume, area, centre = float(mesh.volume), float(mesh.area), np.array(mesh.center_mass)
    volume_error = float(small.volume) / volume - 1.0
    grow = (volume / float(small.volume)) ** (1.0 / 3.0)
    middle = np.array(small.center_mass)
    small = trimesh.Trimesh((small.vertices - middle) * grow + centre, small.faces, process=False)
    return small, Simplification(
        faces_before=len(mesh.faces),
        volume_error=volume_error,
        area_error=float(small.area) / area - 1.0,
    )


def _collapsed(mesh: Any, size: float, max_faces: int, rate: float) -> Any:
    """What fast-simplification makes of a surface; it may be open."""
    import fast_simplification

    centre = mesh.vertices.mean(axis=0)
    points, faces = fast_simplification.simplify(
        np.ascontiguousarray((mesh.vertices - centre) / size, np.float32),
        np.ascontiguousarray(mesh.faces, np.int32),
        target_count=max_faces,
        agg=rate,
    )
    vertices = np.asarray(points, np.float64) * size + centre
    return trimesh.Trimesh(vertices, np.asarray(faces, np.int64), process=False)


def _keeps_shape(small: Any, mesh: Any) -> bool:
    """Whether a simpler surface is closed, and near the volume and area of the one that it stands for."""
    if len(small.faces) < 4 or not is_closed(small):
        return False
    part = float(small.volume / mesh.volume)
    if abs(part - 1.0) > MAX_VOLUME_ERROR:
        return False
    return bool(abs(small.area / mesh.area / part ** (2.0 / 3.0) - 1.0) <= MAX_AREA_ERROR)


def capped(mesh: Any) -> Any:
    """An open mesh closed across its edges, every loop by triangles about its middle; others as they are."""
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    if count_open_edges(mesh.faces) == 0:
        return mesh
    edges = np.asarray(mesh.faces)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, where, counts = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    rim = edges[counts[where.ravel()] == 1]
    count = len(mesh.vertices)
    graph = coo_array((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(count, count))
    loops = connected_components(graph, directed=False)[1][rim[:, 0]]
    vertices, faces = [mesh.vertices], [mesh.faces]
    for k, loop in enumerate(np.unique(loops)):
        ring = rim[loops == loop]
        vertices.append(mesh.vertices[np.unique(ring)].mean(axis=0)[None])
        faces.append(np.column_stack([ring[:, ::-1], np.full(len(ring), count + k)]))
    return trimesh.Trimesh(np.vstack(vertices), np.vstack(faces), process=False)


def decked(mesh: Any) -> Any:
    """The surface with every basin filled to its lowest rim: no water inside an open boat, z up.

    Pockets are what the convex hull has more. A part of one below a level is a basin if it meets the convex
    hull nowhere but at that level or with a face that looks up: the deck.
    """
    outer = convex_hull(mesh.vertices)
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    solid = _manifold(mesh)
    pockets = (_manifold(outer) - solid).decompose()
    planes = np.hstack(
        [outer.face_normals, -np.sum(outer.face_normals * outer.triangles[:, 0], axis=1)[:, None]]
    )
    sides = np.unique(np.round(planes[planes[:, 2] < 1e-3], 9), axis=0)
    basins: list[Any] = []
    for pocket in pockets:
        if pocket.volume() > 1e-9 * extent**3:
            basins += _basins(pocket, sides, extent)
    if not basins:
        return mesh
    return union([mesh, *[_surface(basin, extent) for basin in basins]])


def _basins(pocket: Any, sides: Array, extent: float) -> list[Any]:
    """Parts of a pocket that hold water: each up to the level at which it would spill."""
    box = pocket.bounding_box()
    low, high = box[2], box[5]
    found: list[Any] = []
    whole = _surface(pocket, extent)
    if not _touches(whole, sides, extent):
        return [pocket]
    levels = np.unique(np.round(whole.vertices[:, 2], 12))
    # every vertex may be a rim: the highest level at which some part is still a basin, from the top
    rest = pocket
    for level in levels[(levels > low) & (levels < high)][::-1]:
        rest = rest.trim_by_plane((0.0, 0.0, -1.0), -float(level))
        if rest.is_empty():
            break
        leaky = []
        for part in rest.decompose():
            if part.volume() <= 1e-9 * extent**3:
                continue
            if _touches(_surface(part, extent), sides, extent):
                leaky.append(part)
            else:
                found.append(part)
        if not leaky:
            break
        rest = manifold3d.Manifold.compose(leaky)
    return found


def _touches(mesh: Any, sides: Array, extent: float) -> bool:
    """Whether a triangle of a surface lies in one of the planes (n, 4)."""
    for normal, offset in zip(sides[:, :3], sides[:, 3], strict=True):
        near = np.abs(mesh.vertices @ normal + offset) < 1e-7 * extent
        if near[mesh.faces].all(axis=1).any():
            return True
    return False
