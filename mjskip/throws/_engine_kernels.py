"""Engines as C functions void(context, states after a step, unused), and steps of them in a row.

The context of MuJoCo is what the places below name, addresses as the bits of doubles; of the pure integrator over
waves it is that of `mjskip.waves._kick_kernels.kick_step`.
"""

from typing import Any

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, as_doubles, bits, call_address, place_of
from mjskip.coupling._free_joint_kernels import free_body
from mjskip.rigid.state import STATE
from mjskip.waves._coupled_arrays import coupled_at
from mjskip.waves._coupled_loads import add_loads, rest_loads

STEP, MODEL, DATA = 0, 1, 2  # void mj_step(model, data), and both
QPOS, QVEL, APPLIED = 3, 4, 5  # where the data has them
BODIES = 6  # how many stones
COUPLED, WRENCH = 7, 8  # words of `Coupled` over waves, the force kernel
STONES = (
    9  # then for each stone: where its pose and its velocity begin, its body's id, its centre (3)
)
STONE = 6


@kernel
def _read_states(context: Any, states_out: Any) -> None:
    """States (n, 18) of the stones in a row, as MuJoCo's data has them now."""
    qpos, qvel = bits(context[QPOS]), bits(context[QVEL])
    for n in range(int(context[BODIES])):
        k = STONES + STONE * n
        pose = as_doubles(qpos + 8 * int(context[k]))
        velocity = as_doubles(qvel + 8 * int(context[k + 1]))
        centre = (context[k + 3], context[k + 4], context[k + 5])
        free_body(pose, velocity, centre, place_of(states_out, STATE * n))


def mujoco_states(context: Any, states_out: Any, _unused: Any) -> None:
    """States of the stones as they are."""
    _read_states(context, states_out)


def mujoco_step(context: Any, states_out: Any, _unused: Any) -> None:
    """One step of MuJoCo, and the states after it."""
    call_address(bits(context[STEP]), bits(context[MODEL]), bits(context[DATA]), 0)
    _read_states(context, states_out)


def mujoco_loads(context: Any, _model: Any, _data: Any) -> None:
    """The wrenches of all stones on moving water into `xfrc_applied`: for `Coupling.replace_loads`."""
    c = coupled_at(bits(context[COUPLED]))
    _read_states(context, as_doubles(address_of(c.states)))
    rest_loads(bits(context[WRENCH]), c)
    add_loads(c, 0.0)
    applied = as_doubles(bits(context[APPLIED]))
    for n in range(c.clusters.size):
        body = int(context[STONES + STONE * n + 2])
        for k in range(6):
            applied[6 * body + k] = c.wrenches[n, k] + c.wrenches[n, 6 + k]


@kernel
def advance(step: int, context: Any, states: Any) -> None:
    """As many steps as there are rows of states (m, n, 18), which get the states after each."""
    for m in range(states.shape[0]):
        call_address(step, address_of(context), address_of(states[m]), 0)
