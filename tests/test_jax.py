"""The force law for JAX: equal to the compiled one, and its derivatives to finite differences."""

import os
import sys

import numpy as np
import pytest
from conftest import motions
from hypothesis import given

from mjskip import LAWS, Limits, Stone, Throw, Water, integrate, wrench

# compiling takes far longer here than running
os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=0")
jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402

import mjskip.jax  # noqa: E402
from mjskip.jax import State  # noqa: E402

jax.config.update("jax_enable_x64", True)

PEBBLE = Stone.pebble()
WATERS = {
    **{
        f"{name} {gate}": Water(law=name, gate=gate) for name in LAWS for gate in ("centre", "local")
    },
    **{
        f"{name} {gate} quadrature": Water(law=name, gate=gate, quadrature=True)
        for name, law in LAWS.items() if not law.forward for gate in ("centre", "local")
    },
    "floating": Water(gate="local", buoyancy=True, skin_friction=True, density=900.0),
}  # fmt: skip


def random_states(count, seed=0, speed=5.0, spin=50.0):
    """A state with leading axis `count`, near the surface."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(count, 4))
    return State(
        np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(-0.03, 0.03, count)]),
        q / np.linalg.norm(q, axis=1, keepdims=True),
        speed * rng.normal(size=(count, 3)),
        spin * rng.normal(size=(count, 3)),
    )


def at(states, k):
    return State(*(value[k] for value in states))


FEW = ["floating", "bocquet2003 centre"]
"""All terms of the formula, both gates: to compile takes seconds each."""
INTEGRATED = ["rayleigh1876_forward centre", "bocquet2003 local quadrature"]


def some(quick):
    """These waters, and the others among the slow tests."""
    return pytest.mark.parametrize(
        "name", [n if n in quick else pytest.param(n, marks=pytest.mark.slow) for n in WATERS]
    )


@some([*FEW, *INTEGRATED])
def test_the_load_is_the_compiled_one(name):
    water = WATERS[name]
    load = jax.jit(jax.vmap(mjskip.jax.wrench(PEBBLE, water)))
    states = random_states(200)
    found = load(states)
    for k in range(200):
        one = at(states, k)
        expected = wrench(
            PEBBLE, water, position=one.position, q=one.q, velocity=one.velocity, omega=one.omega
        )
        scale = 1e-12 * (1.0 + np.abs(expected.force).max())
        np.testing.assert_allclose(found.force[k], expected.force, atol=scale)
        np.testing.assert_allclose(found.torque[k], expected.torque, atol=scale)
        np.testing.assert_allclose(found.air_force[k], expected.air_force, atol=scale)
        np.testing.assert_allclose(found.air_torque[k], expected.air_torque, atol=scale)


def flat(state):
    return jnp.concatenate(state)


def unflat(x):
    return State(x[:3], x[3:7], x[7:10], x[10:])


@some(FEW)
def test_derivatives_are_those_of_finite_differences(name):
    load = mjskip.jax.wrench(PEBBLE, WATERS[name])

    def numbers(x):
        return jnp.concatenate(load(unflat(x)))

    value, forward = (jax.jit(jax.vmap(f)) for f in (numbers, jax.jacfwd(numbers)))
    states = random_states(40, seed=3)
    x = np.hstack(states)
    found = np.asarray(forward(x))
    assert np.isfinite(found).all()

    def differences(h):
        columns = []
        for k in range(x.shape[1]):
            move = np.zeros(x.shape[1])
            move[k] = h
            columns.append((value(x + move) - value(x - move)) / (2.0 * h))
        return np.stack(columns, axis=2)

    fine, coarse = differences(1e-6), differences(2e-6)
    scale = np.abs(found).max(axis=(1, 2), keepdims=True)
    # a face that enters the law's gate between the two points is a kink, where there is no derivative
    smooth = np.abs(fine - coarse).max(axis=(1, 2)) < 1e-7 * scale[:, 0, 0]
    assert smooth.mean() > 0.8
    error = np.abs(fine - found) / scale
    assert error[smooth].max() < 1e-6


def test_derivatives_are_finite_where_formulas_divide_by_zero_and_grad_is_jacfwd():
    load = mjskip.jax.wrench(PEBBLE, WATERS["floating"])
    states = np.zeros((4, 13))
    states[:3, 2], states[:3, 3] = [-1.0, 0.0, 1.0], 1.0  # at rest: sunk, at the surface, dry
    states[3] = np.hstack(at(random_states(2), 1))

    def lift(x):
        return load(unflat(x)).force[2]

    found = jax.jit(jax.vmap(jax.grad(lift)))(states)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(
        found, jax.jit(jax.vmap(jax.jacfwd(lift)))(states), rtol=1e-9, atol=1e-9
    )


def test_the_water_s_density_can_be_differentiated():
    load = mjskip.jax.wrench(PEBBLE, Water(density=1000.0))
    state = at(random_states(5), 1)
    found, slope = jax.jit(
        lambda density: jax.jvp(lambda rho: load(state, density=rho).force, (density,), (1.0,))
    )(1000.0)
    np.testing.assert_allclose(1000.0 * slope, found, rtol=1e-12, atol=1e-12)


@given(motions())
def test_any_motion_gives_the_compiled_load(motion):
    one = State(motion["position"], motion["q"], motion["velocity"], motion["omega"])
    found = LOAD(one)
    expected = wrench(PEBBLE, **motion)
    scale = 1e-12 * (1.0 + np.abs(expected.force).max())
    np.testing.assert_allclose(found.force, expected.force, atol=scale)


LOAD = jax.jit(mjskip.jax.wrench(PEBBLE))


def test_a_throw_is_the_one_of_the_pure_integrator():
    throw = Throw.from_degrees(speed=10.0, height=0.05)
    # one keeps momenta, the other velocities: their errors of fourth order differ
    reference = integrate(PEBBLE, throw, timestep=2.5e-4, limits=Limits(duration=0.3))
    start = throw.state(PEBBLE)
    states = jax.jit(
        lambda s: mjskip.jax.free_flight(
            s, LOAD, steps=1200, timestep=2.5e-4, mass=PEBBLE.mass, inertia=PEBBLE.inertia
        )
    )(State(start.position, start.q, start.velocity, start.omega))
    assert reference.contacts
    np.testing.assert_allclose(states.position[-1], reference.position[1200], atol=1e-6)
    np.testing.assert_allclose(states.velocity[-1], reference.velocity[1200], atol=1e-4)


@pytest.mark.parametrize(
    ("water", "says"),
    [
        (Water.floating(radiation=True), "radiation is True: for JAX water is still"),
        (Water(law="rayleigh1876_forward", added_mass=0.5), "added_mass is 0.5: for JAX leave it out"),
    ],
)  # fmt: skip
def test_water_that_is_not_known_here_is_refused(water, says):
    with pytest.raises(ValueError, match=says):
        mjskip.jax.wrench(PEBBLE, water)


def test_single_precision_is_refused():
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(ValueError, match="JAX works in single precision"):
            mjskip.jax.wrench(PEBBLE)
    finally:
        jax.config.update("jax_enable_x64", True)


def test_who_loads_a_model_with_the_plugin_after_mjx_is_told_that_mjx_drops_it(monkeypatch):
    from types import ModuleType

    import mujoco

    from mjskip import register_plugin
    from mjskip.coupling.plugin import MJX, _warned
    from mjskip.errors import MjskipWarning

    register_plugin()
    monkeypatch.setitem(sys.modules, "mujoco.mjx", ModuleType("mujoco.mjx"))
    if MJX in _warned:
        _warned.remove(MJX)
    with pytest.warns(MjskipWarning, match=r"MJX is loaded, which drops plugin mjskip\.water"):
        mujoco.MjModel.from_xml_string(
            '<mujoco><extension><plugin plugin="mjskip.water"><instance name="w"/></plugin></extension>'
            '<worldbody><body><freejoint/><plugin instance="w"/><geom size=".1"/></body></worldbody></mujoco>'
        )
