"""The pure integrator over waves: a step of bodies that are kicked by loads found together with the surface."""

from typing import Any

import numba

from mjskip._compile.pointers import as_doubles, bits
from mjskip.rigid import _rigid_kernels as rigid
from mjskip.rigid.state import STATE
from mjskip.waves import _coupling_kernels as coupling
from mjskip.waves._coupled_arrays import (
    coupled_at,
)
from mjskip.waves._coupled_loads import add_loads, find_faces, rest_loads

KICK_COUPLED, KICK_WRENCH, KICK_Y, KICK_ROWS, KICK_TIMESTEP = range(5)
"""Of the context of `kick_step`: address of the words of `Coupled`, of the force kernel, of x, q, P, L of the bodies
(n, 13) and of their rows (n, rigid.BODY), as the bits of doubles; dt [s]."""

TURN = 0.02
"""Greatest angle of one step of a free flight [rad]: energy is then kept to 1e-10 a second at hundreds of turns."""


def kick_step(context: Any, states_out: Any, _unused: Any) -> None:
    """A step of the pure integrator over waves: void(double*, double*, double*).

    Free flight over half the step, a kick by water and air at the pose there, free flight over the other half.
    The loads are solved with the mean of the velocities before and after the kick: with the surface's step the
    energy of both falls by what the relative motion dissipates, to rounding.
    """
    c = coupled_at(bits(context[KICK_COUPLED]))
    n = c.clusters.size
    y = numba.carray(as_doubles(bits(context[KICK_Y])), (n, rigid.SIZE))
    rows = numba.carray(as_doubles(bits(context[KICK_ROWS])), (n, rigid.BODY))
    timestep = context[KICK_TIMESTEP]
    for b in range(n):
        coupling.free_flight(rows[b], y[b], 0.5 * timestep, TURN, c.states[b])
        rigid.motion(rows[b], y[b], c.states[b])
    rest_loads(bits(context[KICK_WRENCH]), c)
    for b in range(n):
        for k in range(6):
            c.first[b, k] = c.wrenches[b, k] + c.wrenches[b, 6 + k]
    coupling.prepare_kick(y, rows, c.first, timestep, c.states, c.means, c.mobilities)
    find_faces(c)
    add_loads(c, 0.5 * timestep)
    for b in range(n):
        for k in range(6):
            y[b, rigid.P + k] += timestep * (c.wrenches[b, k] + c.wrenches[b, 6 + k])
        coupling.free_flight(rows[b], y[b], 0.5 * timestep, TURN, c.states[b])
        rigid.motion(rows[b], y[b], c.states[b])
        for k in range(STATE):
            states_out[STATE * b + k] = c.states[b, k]
