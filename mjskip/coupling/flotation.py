"""How the trees of a model float: `float_at_rest`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_type
from mjskip.coupling.attach import Coupling
from mjskip.coupling.bodies import body_id, body_name, free_bodies, posed
from mjskip.coupling.plugin_keys import plugin_settings
from mjskip.coupling.selection import BodyRule, GeomRule
from mjskip.coupling.wet import HullOptions, Interior
from mjskip.errors import MjskipWarning, SceneError
from mjskip.hydro import hydrostatics
from mjskip.hydro.hydrostatics import Flotation
from mjskip.hydro.water import Water
from mjskip.rigid.attitude import matrices, quaternions


@dataclass(frozen=True, kw_only=True, repr=False)
class ModelFlotation(Flotation):
    """A free tree of a model at rest in still water, its joints as they are.

    Attributes:
        body: name of the tree's root.
        qpos: of the whole model (nq,), the tree afloat and all else as it was.
    """

    body: str
    qpos: Array


def float_at_rest(
    model: mujoco.MjModel,
    data: mujoco.MjData | None = None,
    *,
    water: Water | None = None,
    body: str | int | None = None,
    bodies: BodyRule = None,
    geoms: GeomRule = None,
    interior: Interior | None = None,
    max_faces: int = HullOptions.max_faces,
) -> ModelFlotation:
    """Draft, trim and heel at which a free tree of a model floats, its joints held.

    The equilibrium is the one that it comes to from its attitude: least potential energy nearby. Overlaps between
    bodies across a joint bear twice, as they do in the simulation.

    Args:
        model: compiled model.
        data: pose to begin from, of the joints too; `qpos0` if None. It is not altered.
        water: the fluid, for its density; that of the plugin where the tree carries it, or `Water()`.
        body: any body of the tree; the first free body's if None.
        bodies, geoms, interior, max_faces: see `mjskip.attach`; as the plugin says where the tree carries it.

    Raises:
        SinksError: the tree is too heavy to float.
        SceneError: no free tree has that body.
    """
    check_type("model", model, mujoco.MjModel, "give what mujoco.MjModel.from_xml_path(file) makes")
    root = tree_root(model, body)
    settings = plugin_settings(model, root)
    options = HullOptions(interior=interior or "flooded", max_faces=max_faces)
    if settings is not None:
        water, geoms = water or settings.water, settings.geoms if geoms is None else geoms
        options = (
            settings.options if interior is None else replace(settings.options, interior=interior)
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MjskipWarning)
        coupling = Coupling(
            model, data, water or Water.floating(), bodies=bodies, geoms=geoms, options=options
        )
    return flotation_of(coupling, data, root)


def tree_root(model: mujoco.MjModel, body: str | int | None) -> int:
    """Root of the free tree that a body belongs to; the first free body if None.

    Raises:
        SceneError: there is none.
    """
    free = free_bodies(model)
    if body is None:
        root = free[0] if free else 0
    else:
        root = int(model.body_rootid[body_id(model, body)])
    if root not in free:
        raise SceneError(
            "only what has a free joint floats: name a body of a tree whose root has one"
        )
    return root


def flotation_of(
    coupling: Coupling, data: mujoco.MjData | None = None, body: str | int | None = None
) -> ModelFlotation:
    """The same for bodies that are coupled already."""
    model = coupling.model
    own = posed(model, data)
    root = tree_root(model, body)
    triangles = coupling.triangles(own, root)
    centre = np.array(own.subtree_com[root])
    found = hydrostatics.float_at_rest(
        triangles,
        mass=float(model.body_subtreemass[root]),
        centre_of_mass=centre,
        density=coupling.water.density,
    )
    address = int(model.jnt_qposadr[model.body_jntadr[root]])
    qpos = np.array(own.qpos)
    start = np.array(qpos[address : address + 3])
    rotation = matrices(qpos[address + 3 : address + 7])
    placed = found.rotation @ (start - centre) + [centre[0], centre[1], found.centre_of_mass]
    qpos[address : address + 3] = placed
    turned = found.rotation @ rotation
    qpos[address + 3 : address + 7] = quaternions(turned[None])[0]
    trim, heel = hydrostatics.trim_and_heel(turned)
    return ModelFlotation(
        draft=found.draft,
        trim=trim,
        heel=heel,
        rotation=turned,
        centre_of_mass=found.centre_of_mass,
        hydrostatics=coupling_hydrostatics(coupling, qpos, root),
        body=body_name(model, root),
        qpos=qpos,
    )


def coupling_hydrostatics(
    coupling: Coupling, qpos: Sequence[float] | Array, root: int
) -> hydrostatics.Hydrostatics:
    """Hydrostatics of a tree in a pose."""
    data = mujoco.MjData(coupling.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(coupling.model, data)
    mujoco.mj_comPos(coupling.model, data)
    return coupling.hydrostatics(data, root)
