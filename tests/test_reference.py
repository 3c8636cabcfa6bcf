"""The pure integrator against closed forms, exact laws and the oracle of physics.md."""

import math

import numpy as np
import pytest
import trimesh
from conftest import GRAVITY, rotation, twin

from mjskip import Limits, Stone, Throw, Water, integrate
from mjskip.errors import DivergedError
from mjskip.rigid.attitude import angles, difference, matrices
from mjskip.throws.comparison import observed_order
from mjskip.throws.throw import State

NO_AIR = Water(air_density=0.0)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def until(duration, **changes):
    """Limits that end a run by time alone."""
    return Limits(duration=duration, max_contact=1e9, sink_depth=1e9, rest_time=1e9, **changes)


def started(height=1.0, velocity=(0, 0, 0), omega=(0, 0, 0), q=UPRIGHT):
    return State(
        position=np.array([0.0, 0.0, height]),
        q=np.asarray(q, dtype=float),
        velocity=np.asarray(velocity, dtype=float),
        omega=np.asarray(omega, dtype=float),
    )


# --- exact laws ---------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["midpoint", "rk4", "adaptive"])
def test_a_stone_in_vacuum_flies_a_parabola(method):
    start = started(height=50.0, velocity=(5.0, 1.0, 2.0), omega=(3.0, 2.0, 40.0))
    run = integrate(
        Stone.pebble(), start, water=NO_AIR, integrator=method, timestep=1e-3, limits=until(1.0)
    )
    t = run.time[:, None]
    exact = start.position + start.velocity * t - 0.5 * GRAVITY * t**2 * [0, 0, 1]
    # a parabola is exact from second order on: rounding of 1000 steps at 50 m
    np.testing.assert_allclose(run.position, exact, atol=1e-10)
    assert run.time[-1] == pytest.approx(1.0)
    assert run.contacts == ()
    assert run.end == "out of time"


def test_a_spinning_disc_wobbles_at_the_rate_of_its_moments(clanet):
    """Torque-free: the normal goes round L at I3 omega3 / (I1 cos theta)."""
    theta, omega3 = math.radians(10.0), 100.0
    i1, i3 = clanet.inertia[0, 0], clanet.inertia[2, 2]
    omega = np.array([i3 * omega3 * math.tan(theta) / i1, 0.0, omega3])
    run = integrate(
        clanet, started(height=90.0, omega=omega), water=NO_AIR, timestep=1e-4, limits=until(0.5)
    )
    axis = run.L[0] / np.linalg.norm(run.L[0])
    normal = matrices(run.q)[:, :, 2]
    np.testing.assert_allclose(normal @ axis, math.cos(theta), rtol=1e-7)
    across = normal - np.outer(normal @ axis, axis)
    e1 = across[0] / np.linalg.norm(across[0])
    angle = np.unwrap(np.arctan2(across @ np.cross(axis, e1), across @ e1))
    rate = angle[-1] / run.time[-1]
    expected = i3 * omega3 / (i1 * math.cos(theta))
    assert rate == pytest.approx(expected, rel=1e-6)  # physics.md asks for 0.1%
    assert np.ptp(np.linalg.norm(run.L, axis=1)) < 1e-12 * np.linalg.norm(run.L[0])
    assert np.ptp(run.energy) < 1e-9 * run.energy[0]


def test_a_disc_falling_broadside_reaches_its_terminal_speed(clanet):
    water = Water(air_density=1.2)
    terminal = math.sqrt(clanet.mass * GRAVITY / (1.2 * clanet.disc_area))
    run = integrate(clanet, started(height=400.0), water=water, timestep=2e-3, limits=until(6.0))
    # u = uT tanh(g t / uT)
    exact = -terminal * np.tanh(GRAVITY * run.time / terminal)
    np.testing.assert_allclose(run.velocity[:, 2], exact, atol=1e-9)
    assert run.velocity[-1, 2] == pytest.approx(-terminal, rel=1e-3)


def test_a_flat_drop_of_a_disc_slows_as_the_closed_form_says():
    """Fixes the missing 1/2: u^2 = uT^2 + (u0^2 - uT^2) exp(-2 s / (sigma h)), uT^2 = sigma g h."""
    disc = Stone.disc(0.05, 0.01, density=2700.0)
    start = started(height=0.005, velocity=(0, 0, -3.0))
    run = integrate(disc, start, water=NO_AIR, timestep=1e-5, limits=until(0.05))
    sunk = 0.005 - run.position[:, 2]
    mass_per_area = 2.7 * 0.01
    terminal2 = GRAVITY * mass_per_area
    exact = terminal2 + (9.0 - terminal2) * np.exp(-2.0 * sunk / mass_per_area)
    # the step that crosses the surface may be wrong by all of its travel: 2 u0 dt / (sigma h) of u^2
    np.testing.assert_allclose(run.velocity[:, 2] ** 2, exact, rtol=2 * 3.0 * 1e-5 / mass_per_area)
    assert run.velocity[-1, 2] ** 2 < 0.25 * 9.0


@pytest.mark.parametrize("spin", [0, 30, 150])
@pytest.mark.parametrize("attack", [-10, 10, 35])
def test_water_never_adds_energy_with_the_local_gate(spin, attack):
    throw = Throw.from_degrees(speed=8, spin=spin, attack=attack, descent=15, height=0.01, wobble=2)
    run = integrate(
        Stone.pebble(), throw, water=Water(gate="local"), timestep=2e-5, limits=until(0.2)
    )
    assert run.contacts
    # RK4's own error on a kinked force, per step
    assert np.diff(run.energy).max() < 1e-8 * run.energy[0]
    assert run.energy[-1] < run.energy[0]


def test_buoyancy_is_no_part_of_the_law():
    """Equation (1) has no static pressure: a light stone at rest in deep water falls freely."""
    run = integrate(
        Stone.pebble(density=500),
        started(height=-1.0),
        water=NO_AIR,
        timestep=1e-4,
        limits=until(1e-3),
    )
    assert run.velocity[-1, 2] == pytest.approx(-GRAVITY * 1e-3, rel=1e-3)


# --- symmetry -----------------------------------------------------------------------------------


def skipping(**changes):
    settings = {"speed": 8, "spin": 20, "attack": 20, "descent": 10, "height": 0.02} | changes
    return Throw.from_degrees(**settings)


def test_the_mirrored_throw_flies_the_mirrored_path():
    disc = Stone.disc(0.05, 0.005, segments=16, density=2500)
    mirror = np.array([1.0, -1.0, 1.0])
    image = Stone.of_parts(
        vertices=disc.vertices * mirror,
        faces=disc.faces[:, ::-1],
        mass=disc.mass,
        centre=np.zeros(3),
        inertia=disc.inertia,
    )
    runs = [
        integrate(stone, skipping(spin=s, bank=b), timestep=1e-4, limits=until(0.08))
        for stone, s, b in ((disc, 20, 5), (image, -20, -5))
    ]
    assert runs[0].contacts
    assert abs(runs[0].position[-1, 1]) > 1e-4
    # rounding, grown through the touch
    np.testing.assert_allclose(runs[0].position, runs[1].position * mirror, atol=1e-11)
    np.testing.assert_allclose(runs[0].L, runs[1].L * -mirror, atol=1e-10)


def test_spin_counter_clockwise_from_above_bends_the_path_to_the_left(clanet):
    ends = {}
    for spin in (-400, 0, 400):
        throw = Throw.from_degrees(speed=3.5, spin=spin, attack=20, descent=20, height=0)
        ends[spin] = integrate(
            clanet, throw, water=NO_AIR, timestep=1e-4, limits=until(0.06)
        ).position[-1]
    assert ends[400][1] > 1e-4
    assert ends[-400][1] < -1e-4
    assert abs(ends[0][1]) < 1e-6  # the diagonals of the rim's quadrangles are not mirrored


def test_a_stone_without_spin_dives_nose_down(clanet):
    throw = Throw.from_degrees(speed=3.5, spin=0, attack=20, descent=20, height=0)
    run = integrate(clanet, throw, water=NO_AIR, timestep=1e-4, limits=Limits(duration=0.5))
    normal = matrices(run.q)[:, :, 2]
    attack = np.degrees(np.arcsin(-normal[:, 0]))
    assert attack[200] < 0.0  # after 20 ms: nose down
    assert run.skips == 0
    assert run.contacts[0].exit is None
    assert run.end == "sunk"


def test_both_signs_of_the_paper_turned_round_give_the_same_path_and_one_alone_does_not():
    """The paper prints V_i = r x omega and tau = F x r, for a left-handed omega.

    Its omega is ours turned round: with omega -> -omega and tau -> -tau nothing changes. The three
    paths here are integrated in NumPy, with the slow twin of the force law; the first is also that of
    the package.
    """
    disc = Stone.disc(0.05, 0.008, segments=11, density=2500)
    start = skipping(spin=15, bank=3, height=0.0).state(disc)
    step, steps = 5e-4, 80

    def path(force_handed, motion_handed):
        """omega and L with the sign of motion_handed; the law with the sign of force_handed."""
        turn = rotation(start.q)
        momentum = motion_handed * turn @ disc.inertia @ turn.T @ start.omega
        y = np.concatenate([start.position, start.q, start.velocity, momentum])

        def rate(y):
            q = y[3:7] / np.linalg.norm(y[3:7])
            turn = rotation(q)
            omega = turn @ np.linalg.solve(disc.inertia, turn.T @ y[10:])
            force, torque, air, air_torque = twin(
                disc, Water(), y[:3], q, y[7:10], omega, handed=force_handed
            )
            wx, wy, wz = motion_handed * omega  # a left-handed omega turns the other way
            w, a, b, c = y[3:7]
            spin = [-wx * a - wy * b - wz * c, wx * w + wy * c - wz * b,
                    wy * w + wz * a - wx * c, wz * w + wx * b - wy * a]  # fmt: skip
            pull = (force + air) / disc.mass - [0, 0, GRAVITY]
            return np.concatenate([y[7:10], 0.5 * np.array(spin), pull, torque + air_torque])

        for _ in range(steps):
            k1 = rate(y)
            k2 = rate(y + 0.5 * step * k1)
            k3 = rate(y + 0.5 * step * k2)
            k4 = rate(y + step * k3)
            y = y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            y[3:7] /= np.linalg.norm(y[3:7])
        return y

    ours, printed = path(1.0, 1.0), path(-1.0, -1.0)
    mixed = path(-1.0, 1.0)
    package = integrate(disc, start, timestep=step, limits=until(step * steps))
    assert package.contacts
    # rounding, grown through a touch of 40 ms
    np.testing.assert_allclose(package.position[-1], ours[:3], atol=1e-11)
    assert float(difference(package.q[-1], ours[3:7])) < 1e-9
    np.testing.assert_allclose(printed[:10], ours[:10], atol=1e-11)
    np.testing.assert_allclose(printed[10:], -ours[10:], atol=1e-11)
    assert np.linalg.norm(mixed[:3] - ours[:3]) > 1e-3  # another model: millimetres apart


# --- the oracle ---------------------------------------------------------------------------------


def test_the_frozen_disc_leaves_the_water_as_three_codes_say(frozen_touch):
    touch = frozen_touch.contacts[0]
    assert frozen_touch.skips == 1
    vx, _, vz = touch.exit.velocity
    assert vx == pytest.approx(2.594, rel=0.01)
    assert vz == pytest.approx(0.231, rel=0.04)
    assert touch.exit.time - touch.entry.time == pytest.approx(0.0489, rel=0.04)
    assert touch.depth / (2 * 0.025 * math.sin(math.radians(20))) == pytest.approx(0.533, rel=0.02)


def test_the_speed_along_a_frozen_face_changes_by_gravity_alone(frozen_touch):
    """Only its flat faces are loaded: dv along the face = -g sin(alpha) tau."""
    alpha = math.radians(20)
    face = np.array([math.cos(alpha), 0, math.sin(alpha)])
    touch = frozen_touch.contacts[0]
    tau = touch.exit.time - touch.entry.time
    along = (np.array(touch.exit.velocity) - touch.entry.velocity) @ face
    rim = abs((frozen_touch.force @ face) / np.linalg.norm(frozen_touch.force, axis=1).clip(1e-9))
    # the rim of the disc is loaded too where it meets the motion; without it the law is exact
    sheet = Stone.disc(0.025, 1e-5, density=2700.0 * 275)
    run = integrate(
        sheet,
        Throw.from_degrees(speed=3.5, spin=0, attack=20, descent=20, height=0),
        water=NO_AIR,
        timestep=1e-4,
        limits=Limits(duration=0.12),
        frozen_attitude=True,
    )
    thin = run.contacts[0]
    tau_thin = thin.exit.time - thin.entry.time
    along_thin = (np.array(thin.exit.velocity) - thin.entry.velocity) @ face
    # the rim that is left, 1e-5 m of it, is loaded by up to rho U^2
    assert along_thin == pytest.approx(-GRAVITY * math.sin(alpha) * tau_thin, rel=5e-3)
    assert along < -GRAVITY * math.sin(alpha) * tau * 0.99
    assert rim.max() < 1.0


@pytest.mark.parametrize(("speed", "leaves"), [(2.92, False), (3.04, True)])
def test_the_slowest_speed_that_bounces_at_20_degrees_is_2_98(clanet, speed, leaves):
    throw = Throw.from_degrees(speed=speed, spin=0, attack=20, descent=20, height=0)
    limits = Limits(duration=0.3)
    run = integrate(clanet, throw, water=NO_AIR, timestep=2e-4, limits=limits, frozen_attitude=True)
    assert (run.contacts[0].exit is not None) == leaves


@pytest.mark.parametrize(
    ("attack", "tau", "ratio"),
    [(15, 55.7, 0.117), (25, 47.2, 0.228), (30, 48.0, 0.237), (40, 58.1, 0.169)],
)
def test_the_rows_of_the_oracle_at_other_attacks(clanet, attack, tau, ratio):
    throw = Throw.from_degrees(speed=3.5, spin=0, attack=attack, descent=20, height=0)
    run = integrate(
        clanet,
        throw,
        water=NO_AIR,
        timestep=2e-4,
        limits=Limits(duration=0.2),
        frozen_attitude=True,
    )
    touch = run.contacts[0]
    # the tolerances of physics.md for tau and vz
    assert (touch.exit.time - touch.entry.time) * 1e3 == pytest.approx(tau, rel=0.04)
    assert touch.exit.velocity[2] / -touch.entry.velocity[2] == pytest.approx(ratio, rel=0.04)


def test_rosellinis_law_at_20_degrees(clanet):
    throw = Throw.from_degrees(speed=3.5, spin=0, attack=20, descent=20, height=0)
    water = Water(air_density=0, law="rosellini2005")
    run = integrate(
        clanet, throw, water=water, timestep=2e-4, limits=Limits(duration=0.2), frozen_attitude=True
    )
    touch = run.contacts[0]
    assert (touch.exit.time - touch.entry.time) * 1e3 == pytest.approx(36.5, rel=0.04)


@pytest.mark.parametrize(("speed", "skips"), [(8, 3), (12, 7)])
def test_the_frozen_disc_of_100_grams_skips_as_often_as_the_oracle(speed, skips):
    disc = Stone.disc(0.05, 0.1 / (2600 * math.pi * 0.05**2), mass=0.1)
    throw = Throw.from_degrees(speed=speed, spin=0, attack=20, descent=10, height=0)
    run = integrate(
        disc, throw, water=NO_AIR, timestep=2e-4, limits=Limits(duration=5), frozen_attitude=True
    )
    assert run.skips == skips


def test_six_degrees_of_freedom_agree_with_the_oracle_at_400_rev_s():
    disc = Stone.disc(0.025, 0.00275, segments=64, density=2700)
    throw = Throw.from_degrees(speed=3.5, spin=400, attack=20, descent=20, height=0)
    run = integrate(disc, throw, water=NO_AIR, timestep=5e-5, limits=Limits(duration=0.1))
    touch = run.contacts[0]
    vx, vy, vz = touch.exit.velocity
    assert vx == pytest.approx(2.597, rel=0.01)
    assert vz == pytest.approx(0.227, rel=0.04)
    # the sideways speed depends on the polygon that stands for the disc: 0.020 with 32 corners, 0.034
    # with these 64, 0.0365 in the limit; the oracle, whose mesh is not known, says 0.031
    assert vy == pytest.approx(0.0344, rel=0.01)
    assert math.degrees(touch.exit.attack) == pytest.approx(19.9, abs=0.1)
    assert math.degrees(touch.exit.bank) == pytest.approx(2.2, abs=0.1)
    assert (touch.exit.time - touch.entry.time) == pytest.approx(0.0492, rel=0.04)


@pytest.mark.parametrize(("spin", "leaves"), [(65, False), (70, True)])
def test_the_smallest_spin_that_leaves_the_water_is_70(clanet, spin, leaves):
    throw = Throw.from_degrees(speed=3.5, spin=spin, attack=20, descent=20, height=0)
    run = integrate(clanet, throw, water=NO_AIR, timestep=1e-4, limits=Limits(duration=0.3))
    assert (run.contacts[0].exit is not None) == leaves


# --- convergence --------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("midpoint", 2), ("rk4", 4)])
def test_each_method_has_its_order_in_smooth_flight(method, order):
    """A wobbling stone in heavy air."""
    stone = Stone.pebble()
    throw = Throw.from_degrees(speed=10, spin=20, wobble=5, attack=30, height=50)
    water = Water(air_density=20.0)
    exact = integrate(
        stone,
        throw,
        water=water,
        integrator="adaptive",
        timestep=0.01,
        limits=until(0.1),
        rtol=1e-12,
    )
    steps = (2.5e-4, 1.25e-4, 6.25e-5)
    runs = [
        integrate(stone, throw, water=water, integrator=method, timestep=h, limits=until(0.1))
        for h in steps
    ]
    position = [float(np.linalg.norm(run.position[-1] - exact.position[-1])) for run in runs]
    attitude = [float(difference(run.q[-1], exact.q[-1])) for run in runs]
    assert observed_order(steps, position) == pytest.approx(order, abs=0.2)
    assert observed_order(steps, attitude) == pytest.approx(order, abs=0.2)


def test_the_yardstick_agrees_with_a_fine_rk4_through_a_touch(clanet):
    throw = Throw.from_degrees(speed=3.5, spin=80, attack=20, descent=20, height=0.01)
    runs = [
        integrate(clanet, throw, water=NO_AIR, integrator=m, timestep=h, limits=until(0.06))
        for m, h in (("adaptive", 1e-3), ("rk4", 1e-5))
    ]
    np.testing.assert_allclose(runs[0].position[-1], runs[1].position[-1], atol=1e-8)
    assert float(difference(runs[0].q[-1], runs[1].q[-1])) < 1e-6


# --- what a trajectory says ----------------------------------------------------------------------


def test_momenta_and_motion_belong_together():
    stone = Stone.pebble()
    run = integrate(stone, skipping(wobble=2), limits=until(0.1))
    turn = matrices(run.q)
    np.testing.assert_allclose(run.P, stone.mass * run.velocity, rtol=1e-12)
    inertia = turn @ stone.inertia @ turn.transpose(0, 2, 1)
    np.testing.assert_allclose(run.L, np.einsum("nij,nj->ni", inertia, run.omega), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(run.q, axis=1), 1.0, atol=1e-14)
    slope = np.gradient(run.position, run.time, axis=0)[1:-1]
    # central differences at 0.5 ms of forces of some hundred m/s^2 that switch on and off
    assert np.abs(slope - run.velocity[1:-1]).max() < 0.05


def test_the_impulse_of_a_touch_is_the_change_of_momentum_less_weight(frozen_touch):
    touch = frozen_touch.contacts[0]
    mass = frozen_touch.mass
    change = mass * (np.array(touch.exit.velocity) - touch.entry.velocity)
    weight = np.array([0, 0, -mass * GRAVITY * (touch.exit.time - touch.entry.time)])
    # trapezoids over 0.1 ms rows
    np.testing.assert_allclose(touch.impulse, change - weight, atol=2e-3 * np.linalg.norm(change))


def test_a_frozen_stone_does_not_turn(frozen_touch):
    assert np.ptp(frozen_touch.q, axis=0).max() < 1e-14
    assert not frozen_touch.omega.any()


def test_the_angles_of_a_moment_are_those_of_the_motion(clanet):
    throw = Throw.from_degrees(speed=3.5, spin=80, attack=20, descent=20, bank=5, height=0)
    run = integrate(clanet, throw, water=NO_AIR, timestep=1e-4, limits=until(0.02))
    entry = run.contacts[0].entry
    assert entry.time == pytest.approx(0.0, abs=1e-12)
    assert math.degrees(entry.attack) == pytest.approx(20, abs=1e-6)
    assert math.degrees(entry.bank) == pytest.approx(5, abs=1e-6)
    assert entry.spin == pytest.approx(80 * 2 * math.pi)
    normal = matrices(run.q[-1])[:, 2]
    assert np.isfinite(angles(normal, run.velocity[-1], run.omega[-1]).attack)


def test_gravity_of_another_planet():
    run = integrate(
        Stone.pebble(), started(10.0), water=NO_AIR, gravity=(0, 0, -1.62), limits=until(1.0)
    )
    assert run.position[-1, 2] == pytest.approx(10.0 - 0.81, abs=1e-9)
    assert np.ptp(run.energy) < 1e-12


def test_arguments_are_left_alone():
    stone, start = Stone.pebble(), skipping().state(Stone.pebble())
    before = start.position.copy(), start.q.copy(), start.velocity.copy(), start.omega.copy()
    integrate(stone, start, limits=until(0.02))
    for old, new in zip(
        before, (start.position, start.q, start.velocity, start.omega), strict=True
    ):
        np.testing.assert_array_equal(old, new)


# --- refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"integrator": "verlet"},
            "integrator is 'verlet': use one of euler, midpoint, rk4, adaptive",
        ),
        ({"timestep": 0.0}, "timestep is 0.0"),
        ({"timestep": math.nan}, "timestep is nan"),
        ({"rtol": -1.0}, "rtol is -1.0"),
    ],
)
def test_options_that_are_none_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        integrate(Stone.pebble(), Throw(), **options)


@pytest.mark.parametrize(
    "name", ["duration", "min_airtime", "max_contact", "sink_depth", "rest_time"]
)
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_limits_that_are_none_are_refused(name, value):
    with pytest.raises(ValueError, match=f"^{name} is "):
        Limits(**{name: value})


def test_a_step_that_is_far_too_long_is_reported_with_body_and_time():
    with pytest.raises(
        DivergedError, match=r"body 'pebble' diverged at t = .* smaller time step"
    ) as it:
        integrate(
            Stone.pebble(),
            started(-0.5, (0, 0, -900)),
            integrator="euler",
            timestep=0.05,
            limits=until(5.0),
            name="pebble",
        )
    assert it.value.body == "pebble"
    assert it.value.time > 0.0


def test_a_stone_of_many_faces_is_a_stone():
    run = integrate(
        Stone.from_mesh(trimesh.creation.icosphere(2, radius=0.03)), skipping(), limits=until(0.1)
    )
    assert run.contacts
