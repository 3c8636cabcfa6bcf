"""What water and air do to one wet body of a MuJoCo model: the wrench, and its limit in a step too large.

A *record* of doubles is what both `attach` and the plugin know a wet body by:

    block         address of the block that the force kernel knows it by, as the bits of a double
    centre        of mass, in the body that the force acts on (3) [m]
    inverse mass, mean inverse inertia, inverse inertia (9, axes of the body)
                  of the bodies welded together; zero if they are massless
    arm mobility  greatest (r x n).I^-1 (r x n) of its surface, r from the centre of mass [1/kg]; the greatest
                  |r x n|^2 [m^2] if they are massless
    drag areas    rho c A / 2 [kg/m], rho c sum S |r x n| [kg] of the water, rho_air S_disc [kg/m] of the air
    reach         of the farthest point from the centre of mass [m]
    bearing       density of the water if it bears, or 0 [kg/m^3]
    dissipates    1 if every loaded face takes energy: the gate is local and no law lifts
    needed step   shortest time step that this body asked for [s]; infinite while none was too large

Explicit drag F over a step h changes the motion nu of a body by h M^-1 F. It takes the most energy if
that ends the motion along it,

    h F.M^-1 F = -F.nu,

and beyond twice that it adds energy. Forces that would go beyond are scaled down to it, and the step that they ask
for, h (-F.nu) / (h F.M^-1 F), is kept. Where a face may be pushed along its motion (the gate of the paper, laws that
lift), a step may change velocities at most by the greatest speed on the body instead.

M^-1 is that of the welded bodies alone, or three times MuJoCo's mean inverse weight of the body in its tree where
that is less: the trace, which is no less than its greatest value.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, bits, call_address
from mjskip.hydro._block import SURFACE, WEIGHT_DENSITY

BLOCK = 0
CENTRE = 1
INVERSE_MASS = 4
MEAN_INVERSE_INERTIA = 5
INVERSE_INERTIA = 6
ARM_MOBILITY = 15
MOVING_DRAG = 16
TURNING_DRAG = 17
AIR_DRAG = 18
REACH = 19
BEARING = 20
DISSIPATES = 21
NEEDED_STEP = 22
RECORD = 23

STATE = 18
WRENCH = 12
SCRATCH = STATE + WRENCH
"""Doubles that `wet_load` needs for itself."""


@kernel
def body_state(
    places: int, axes: int, motions: int, origin: int, body: int, record: int, state: int
) -> None:
    """State (18) of a wet body for the force kernel, from MuJoCo's arrays.

    Args:
        places: address of xpos.
        axes: address of xmat.
        motions: address of cvel, which is about `origin`.
        origin: address of the centre of mass of the body's tree (3).
        body: its id.
        record: address of its record.
        state: address of what is written.
    """
    known, pose = as_doubles(record), as_doubles(state)
    place, rotation = as_doubles(places + 24 * body), as_doubles(axes + 72 * body)
    moving, middle = as_doubles(motions + 48 * body), as_doubles(origin)
    for i in range(9):
        pose[3 + i] = rotation[i]
    for i in range(3):
        pose[i] = place[i] + (
            rotation[3 * i] * known[CENTRE]
            + rotation[3 * i + 1] * known[CENTRE + 1]
            + rotation[3 * i + 2] * known[CENTRE + 2]
        )
    wx, wy, wz = moving[0], moving[1], moving[2]
    rx, ry, rz = pose[0] - middle[0], pose[1] - middle[1], pose[2] - middle[2]
    pose[12] = moving[3] + (wy * rz - wz * ry)
    pose[13] = moving[4] + (wz * rx - wx * rz)
    pose[14] = moving[5] + (wx * ry - wy * rx)
    pose[15], pose[16], pose[17] = wx, wy, wz


@kernel
def wet_load(
    wrench: int, record: int, state: int, out: int, scratch: int,
    timestep: float, gravity: float, mobility: float, turning: float,
) -> float:  # fmt: skip
    """Wrench of water and air on a wet body into out (12), and the time step that it asks for [s].

    Args:
        wrench: address of the force kernel.
        record: address of the body's record.
        state: address of its state (18).
        out: address of the wrench (12); not finite if the force is not.
        scratch: address of `SCRATCH` doubles.
        timestep: of the model [s].
        gravity: [m/s^2], positive down.
        mobility: MuJoCo's mean inverse weight of the body in its tree, translation [1/kg].
        turning: the same for rotation [1/(kg m^2)].
    """
    known = as_doubles(record)
    block = bits(known[BLOCK])
    header = as_doubles(block)
    if known[BEARING] != 0.0:
        header[WEIGHT_DENSITY] = known[BEARING] * gravity
    call_address(wrench, block, state, out)

    # inverse inertia of the body in its tree
    per_mass, share = 3.0 * mobility, 3.0 * turning
    if known[INVERSE_MASS] > 0.0:
        per_mass = min(per_mass, known[INVERSE_MASS])
    if known[MEAN_INVERSE_INERTIA] > 0.0:
        share = min(share / known[MEAN_INVERSE_INERTIA], 1.0)

    # No load is too large while h mu sum |F| / V <= 1, by Cauchy and Schwarz: sum S V_n^2 over closed surfaces
    # is less than V_n times (V A / 2 + omega sum S |r x n|), and mu = n.M^-1 n is greatest where the arm is.
    pose, load = as_doubles(state), as_doubles(out)
    speed = math.sqrt(pose[12] * pose[12] + pose[13] * pose[13] + pose[14] * pose[14])
    turn = math.sqrt(pose[15] * pose[15] + pose[16] * pose[16] + pose[17] * pose[17])
    drag = known[AIR_DRAG] * (speed + known[REACH] * turn)
    if load[0] != 0.0 or load[1] != 0.0 or load[2] != 0.0:
        drag += known[MOVING_DRAG] * speed + known[TURNING_DRAG] * turn
    most = timestep * drag * (per_mass + share * known[ARM_MOBILITY])
    if not most > 1.0 or bits(header[SURFACE]) != 0:
        return np.inf
    return _limit(
        wrench,
        block,
        state,
        out,
        scratch,
        timestep,
        speed + known[REACH] * turn,
        known,
        per_mass,
        share,
    )


@kernel
def _keep(load: Any, static: Any, part: float) -> float:
    """Keep a part of the drag in a wrench (12), if it is less than all; the part."""
    if part < 1.0:
        for i in range(6):
            load[i] = static[i] + part * (load[i] - static[i])
            load[6 + i] *= part
    return part


@kernel
def _limit(
    wrench: int, block: int, state: int, out: int, scratch: int,
    timestep: float, speed: float, known: Any, per_mass: float, share: float,
) -> float:  # fmt: skip
    """Scale the drag in a wrench (12) so that it ends the motion along it at most."""
    pose, load = as_doubles(state), as_doubles(out)
    resting, static = as_doubles(scratch), as_doubles(scratch + 8 * STATE)
    # what the water does to the body at rest is no drag
    for i in range(12):
        resting[i] = pose[i]
    for i in range(12, STATE):
        resting[i] = 0.0
    call_address(wrench, block, scratch, scratch + 8 * STATE)
    fx = load[0] + load[6] - static[0]
    fy = load[1] + load[7] - static[1]
    fz = load[2] + load[8] - static[2]
    tx = load[3] + load[9] - static[3]
    ty = load[4] + load[10] - static[4]
    tz = load[5] + load[11] - static[5]
    # torque in body axes, and the turn that it makes
    bx = pose[3] * tx + pose[6] * ty + pose[9] * tz
    by = pose[4] * tx + pose[7] * ty + pose[10] * tz
    bz = pose[5] * tx + pose[8] * ty + pose[11] * tz
    ax, ay, az = share * bx, share * by, share * bz
    if known[MEAN_INVERSE_INERTIA] > 0.0:
        k = INVERSE_INERTIA
        ax = share * (known[k] * bx + known[k + 1] * by + known[k + 2] * bz)
        ay = share * (known[k + 3] * bx + known[k + 4] * by + known[k + 5] * bz)
        az = share * (known[k + 6] * bx + known[k + 7] * by + known[k + 8] * bz)
    if known[DISSIPATES] == 0.0:
        change = per_mass * math.sqrt(fx * fx + fy * fy + fz * fz)
        change += known[REACH] * math.sqrt(ax * ax + ay * ay + az * az)
        change *= timestep
        keep = speed / change if change > speed and change < np.inf else np.inf
        return _keep(load, static, keep) * timestep
    power = -(
        fx * pose[12]
        + fy * pose[13]
        + fz * pose[14]
        + tx * pose[15]
        + ty * pose[16]
        + tz * pose[17]
    )
    change = per_mass * (fx * fx + fy * fy + fz * fz) + ax * bx + ay * by + az * bz
    change *= timestep
    keep = power / change if change > power and power > 0.0 and change < np.inf else np.inf
    return _keep(load, static, keep) * timestep
