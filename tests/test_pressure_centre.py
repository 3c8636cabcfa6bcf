"""Laws whose load acts ahead of the middle of the wet face, by Rayleigh (1876)."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad

from mjskip import Limits, Stone, Throw, Water, integrate, wrench
from mjskip.hydro.laws import LAWS

FORWARD = [name for name, law in LAWS.items() if law.forward]


def tilted(degrees):
    """Nose up: turned about -y."""
    half = math.radians(degrees) / 2.0
    return math.cos(half), 0.0, -math.sin(half), 0.0


@pytest.mark.parametrize("degrees", [5.0, 20.0, 60.0])
def test_a_half_wet_plate_is_loaded_where_rayleigh_says(degrees):
    # a thin square plate moving level, nose up by `degrees`, wet up to its middle line
    side, thin = 0.2, 1e-4
    plate = Stone.from_mesh(trimesh.creation.box((side, side, thin)), density=2700.0)
    load = wrench(
        plate,
        Water(air_density=0.0, law="lee2010_forward"),
        position=(0.0, 0.0, 0.5 * thin * math.cos(math.radians(degrees))),
        q=tilted(degrees),
        velocity=(1.0, 0.0, 0.0),
    )
    lever = load.torque[1] / np.linalg.norm(load.force)  # nose down: the load is behind the middle
    wet, theta = side / 2.0, math.radians(degrees)
    ahead = 0.75 * math.cos(theta) / (4.0 + math.pi * math.sin(theta)) * wet
    # the edge of thickness 1e-4 has no load in this motion but at 90 degrees to the face; its lever is nil
    assert lever == pytest.approx(wet / 2.0 - ahead, rel=5e-3)


@pytest.mark.parametrize("degrees", [5.0, 30.0, 60.0, 89.0])
def test_rayleighs_formula_is_that_of_kirchhoffs_flow_past_a_plate(degrees):
    """The flow itself, by quadrature: on the plate w = V l' / (t - cos theta)^2 and V dz/dw = |t| + sqrt(t^2 - 1),
    |t| > 1, the rims at t = 1 (behind) and -1, the stagnation point at infinity; u = 1 / t."""
    theta = math.radians(degrees)

    def slowness(u):
        return (1.0 + math.sqrt(1.0 - u * u)) / abs(u)

    def length(u):
        return 2.0 * slowness(u) / abs(1.0 / u - math.cos(theta)) ** 3 / u**2

    def load(u):  # over rho V^2
        return 0.5 * (1.0 - slowness(u) ** -2) * length(u)

    def over(function, start, stop):
        return quad(function, start, stop, limit=500)[0]

    behind, front = over(length, 0.0, 1.0), over(length, -1.0, 0.0)
    total, force = behind + front, over(load, 0.0, 1.0) + over(load, -1.0, 0.0)
    moment = over(lambda u: load(u) * over(length, u, 1.0), 0.0, 1.0)
    moment += over(lambda u: load(u) * (behind + over(length, u, 0.0)), -1.0, 0.0)
    sine = math.pi * math.sin(theta)
    assert force / total == pytest.approx(sine / (4.0 + sine), rel=1e-8)
    ahead = 0.75 * math.cos(theta) / (4.0 + sine)
    assert moment / force / total - 0.5 == pytest.approx(ahead, abs=1e-8)


@pytest.mark.parametrize("law", FORWARD)
def test_the_force_is_that_of_the_law_when_nothing_turns(law):
    # without rotation every point of a face has one velocity: only the place of the load differs
    stone = Stone.lens(0.04, 0.02)
    pose = {"position": (0.0, 0.0, 0.002), "q": tilted(15.0), "velocity": (8.0, 0.5, -2.0)}
    ahead = wrench(stone, Water(law=law), **pose)
    middle = wrench(stone, Water(law=law.removesuffix("_forward")), **pose)
    assert ahead.force == pytest.approx(middle.force, rel=1e-12)  # rounding
    assert ahead.torque[1] < middle.torque[1]  # less nose down


def test_cutting_triangles_changes_nothing_where_strips_begin_at_the_waterline():
    plate = trimesh.creation.box((0.2, 0.2, 0.01))
    water = Water(air_density=0.0, law="lee2010_forward")
    pose = {"position": (0.0, 0.0, 0.0), "q": tilted(20.0), "velocity": (3.0, 0.0, -1.0)}
    coarse = wrench(Stone.from_mesh(plate, density=2700.0), water, **pose)
    fine = wrench(Stone.from_mesh(plate.subdivide().subdivide(), density=2700.0), water, **pose)
    assert fine.torque == pytest.approx(coarse.torque, rel=1e-9, abs=1e-9)  # rounding


@pytest.mark.parametrize("law", FORWARD)
@pytest.mark.parametrize("spin", [0.0, 10.0, 65.0])
def test_water_only_takes_energy_by_the_local_gate(law, spin):
    # the velocity of the face is taken where the load acts: the power is -load (V.n) <= 0
    disc = Stone.disc(0.025, 0.00275, density=2700.0)
    throw = Throw.from_degrees(speed=3.5, spin=spin, attack=20.0, descent=20.0, height=0.0)
    water = Water(air_density=0.0, law=law, gate="local")
    energy = integrate(disc, throw, water=water, timestep=1e-4, limits=Limits(duration=0.1)).energy
    assert np.diff(energy).max() <= 1e-9 * energy[0]  # truncation of RK4


def test_the_real_discs_throw_bounces_where_the_papers_law_keeps_it():
    disc = Stone.disc(0.025, 0.00275, density=2700.0)
    throw = Throw.from_degrees(speed=3.5, spin=65.0, attack=20.0, descent=20.0, height=0.0)
    skips = {
        law: integrate(disc, throw, water=Water(air_density=0.0, law=law), timestep=2e-4).skips > 0
        for law in ("lee2010", "lee2010_forward")
    }
    assert skips == {"lee2010": False, "lee2010_forward": True}
