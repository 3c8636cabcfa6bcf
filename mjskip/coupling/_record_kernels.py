"""What water and air do to one wet body of a MuJoCo model: the wrench, and its limit in a step too large.

A *record* of doubles is what both doors, `attach` and the plugin, know a wet body by:

    block         address of the block that the force kernel knows it by, as the bits of a double
    centre        of mass, in the body that the force acts on (3) [m]
    inverse mass, mean and greatest inverse inertia, inverse inertia (9, axes of the body)
                  of the bodies welded together; zero if they are massless
    drag bound    rho c A + rho_air S: no drag at a speed V exceeds this times V^2 [kg/m]
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
MAX_INVERSE_INERTIA = 6
INVERSE_INERTIA = 7
DRAG_BOUND = 16
REACH = 17  # of the farthest point from the centre of mass [m]
BEARING = 18
DISSIPATES = 19
NEEDED_STEP = 20
RECORD = 21

STATE = 18
WRENCH = 12
SCRATCH = STATE + WRENCH
"""Doubles that `wet_load` needs for itself."""


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

    # greatest inverse inertia of the body in its tree
    per_mass, per_inertia = 3.0 * mobility, 3.0 * turning
    if known[INVERSE_MASS] > 0.0:
        per_mass = min(per_mass, known[INVERSE_MASS])
    share = 1.0
    if known[MEAN_INVERSE_INERTIA] > 0.0:
        share = min(per_inertia / known[MEAN_INVERSE_INERTIA], 1.0)
        per_inertia = share * known[MAX_INVERSE_INERTIA]

    # whether any drag can be too much: F <= bound V^2, and no face is faster than V
    pose = as_doubles(state)
    reach = known[REACH]
    speed = math.sqrt(pose[12] * pose[12] + pose[13] * pose[13] + pose[14] * pose[14])
    speed += reach * math.sqrt(pose[15] * pose[15] + pose[16] * pose[16] + pose[17] * pose[17])
    most = timestep * known[DRAG_BOUND] * speed * (per_mass + reach * reach * per_inertia)
    if not most > 1.0 or bits(header[SURFACE]) != 0:
        return np.inf
    return _limit(
        wrench, block, state, out, scratch, timestep, speed, known, per_mass, share, per_inertia
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
    timestep: float, speed: float, known: Any, per_mass: float, share: float, per_inertia: float,
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
    if known[DISSIPATES] == 0.0:
        force, torque = (
            math.sqrt(fx * fx + fy * fy + fz * fz),
            math.sqrt(tx * tx + ty * ty + tz * tz),
        )
        change = timestep * (per_mass * force + known[REACH] * per_inertia * torque)
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
    # torque in body axes, through the inverse inertia
    bx = pose[3] * tx + pose[6] * ty + pose[9] * tz
    by = pose[4] * tx + pose[7] * ty + pose[10] * tz
    bz = pose[5] * tx + pose[8] * ty + pose[11] * tz
    if known[MEAN_INVERSE_INERTIA] > 0.0:
        k = INVERSE_INERTIA
        turned = share * (
            bx * (known[k] * bx + known[k + 1] * by + known[k + 2] * bz)
            + by * (known[k + 3] * bx + known[k + 4] * by + known[k + 5] * bz)
            + bz * (known[k + 6] * bx + known[k + 7] * by + known[k + 8] * bz)
        )
    else:
        turned = per_inertia * (bx * bx + by * by + bz * bz)
    change = timestep * (per_mass * (fx * fx + fy * fy + fz * fz) + turned)
    return (
        timestep * _keep(load, static, power / change)
        if change > power and power > 0.0 and change < np.inf
        else np.inf
    )
