"""Floating hulls against exact laws, against Capytaine (a boundary-element code), and in time."""

import json
from functools import cache
from pathlib import Path

import hulls
import numpy as np
import pytest
import trimesh

from mjskip.hydro.panels import hull_influence, wetted_hull
from mjskip.hydro.radiation import body_modes, known_waves, radiation_table, table_coefficients
from mjskip.hydro.response import (
    FloatingBody,
    coefficients,
    potentials,
    response_amplitudes,
)
from mjskip.hydro.surface_modes import frequency, surface_modes, wavenumber

RHO, G = 1000.0, 9.81
CAPYTAINE = json.loads((Path(__file__).parent / "capytaine.json").read_text())
"""Recorded numbers of Capytaine; scripts/validation/floating_oracle.py makes them."""


@cache
def sphere(fineness=3):
    mesh = trimesh.creation.icosphere(fineness)
    mesh.apply_scale(hulls.RADIUS * (4.0 / 3.0 * np.pi / mesh.volume) ** (1.0 / 3.0))
    return wetted_hull(mesh.triangles, height=0.0, panels=150)


@cache
def disc():
    mesh = trimesh.creation.cylinder(hulls.RADIUS, 0.04, sections=48)
    return wetted_hull(mesh.triangles, height=0.0)


@cache
def barge(panels=160):
    mesh = trimesh.creation.box([1.0, 0.4, 0.2])
    return wetted_hull(mesh.triangles, height=hulls.BARGE_CENTRE, panels=panels)


@cache
def ship():
    return wetted_hull(hulls.ship_triangles(), height=hulls.SHIP_CENTRE)


def body(hull, inertia=(1.0, 1.0, 1.0)):
    mass = RHO * hull.volume
    return FloatingBody(name="body", hull=hull, mass=mass, inertia=np.diag(inertia))


def chosen(dofs):
    return [("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw").index(dof) for dof in dofs]


def test_a_half_sphere_at_infinite_frequency_carries_half_its_water():
    """Half of a deep sphere: the potential vanishes at z = 0."""
    added = hull_influence(sphere()).added_mass(1.0)
    assert added[2, 2] / sphere().volume == pytest.approx(0.5, rel=0.01)


def test_a_deep_sphere_carries_half_its_water_in_all_directions():
    mesh = trimesh.creation.icosphere(3, radius=0.1)
    mesh.apply_translation([0.0, 0.0, -10.0])
    hull = wetted_hull(mesh.triangles, height=-10.0)
    added = hull_influence(hull).added_mass(1.0) / hull.volume
    np.testing.assert_allclose(np.diag(added)[:3], 0.5, rtol=0.01)


@pytest.mark.parametrize("name", ["sphere", "disc", "barge", "ship"])
def test_added_mass_at_infinity_is_capytaines(name):
    hull = {"sphere": sphere, "disc": disc, "barge": barge, "ship": ship}[name]()
    known = CAPYTAINE["converged"][name]
    ours = np.diag(hull_influence(hull).added_mass(RHO))[chosen(known)]
    np.testing.assert_allclose(ours, list(known.values()), rtol=0.03)


def test_the_diagonal_lets_a_coarse_curved_hull_converge():
    coarse = hull_influence(sphere(2)).added_mass(1.0)[2, 2] / sphere(2).volume
    fine = hull_influence(sphere(3)).added_mass(1.0)[2, 2] / sphere(3).volume
    assert abs(fine - 0.5) < 0.4 * abs(coarse - 0.5)  # second order: a quarter


def test_hydrostatics_of_a_box_are_archimedes():
    hull = barge()
    assert hull.volume == pytest.approx(1.0 * 0.4 * 0.1, rel=1e-12)
    np.testing.assert_allclose(hull.buoyancy_centre(), [0.0, 0.0, -0.05], atol=1e-12)
    stiffness = hull.stiffness(density=RHO, gravity=G, mass=RHO * hull.volume)
    assert stiffness[2, 2] == pytest.approx(RHO * G * 0.4)
    assert stiffness[3, 3] == pytest.approx(RHO * G * (0.4**3 / 12.0 - 0.04 * 0.03))
    assert stiffness[4, 4] == pytest.approx(RHO * G * (0.4 / 12.0 - 0.04 * 0.03))


@pytest.mark.parametrize("depth", [np.inf, 0.3])
def test_added_mass_and_damping_of_a_sphere_are_capytaines(depth):
    known = CAPYTAINE["sphere" if np.isinf(depth) else "sphere in water 0.3 m deep"]
    ours = coefficients([body(sphere(2))], known["omega"], density=RHO, depth=depth)
    k = chosen(known["dofs"])
    for name in ("added_mass", "radiation_damping"):
        mine = np.diagonal(ours[name].values[:, k][:, :, k], axis1=1, axis2=2)
        theirs = np.diagonal(np.array(known[name]), axis1=1, axis2=2)
        np.testing.assert_allclose(mine, theirs, rtol=0.05, atol=0.01 * theirs.max())


def amplitudes(known, inertia, stiffness, excitation, dofs):
    """Responses that Capytaine's coefficients give."""
    w = np.array(known["omega"])[:, None, None]
    impedance = (
        -(w**2) * (inertia + np.array(known["added_mass"]))
        - 1j * w * np.array(known["radiation_damping"])
        + stiffness
    )
    return np.linalg.solve(impedance, excitation[..., None])[..., 0]


@pytest.mark.parametrize(
    ("make", "name", "inertia"),
    [
        (sphere, "sphere", (0.06, 0.06, 0.06)),
        (barge, "barge", (0.7, 3.46, 3.5)),
        (ship, "ship", (0.02, 0.35, 0.35)),
    ],
)
def test_response_in_head_waves_is_capytaines(make, name, inertia):
    known, hull = CAPYTAINE[name], make()
    one = body(hull, inertia)
    k = chosen(known["dofs"])
    ours = coefficients([one], known["omega"], density=RHO)
    mine = np.abs(response_amplitudes(ours).values[:, 0][:, k])
    excitation = np.array(known["excitation"][0]) + 1j * np.array(known["excitation"][1])
    stiffness = ours.hydrostatic_stiffness.values[np.ix_(k, k)]
    theirs = np.abs(
        amplitudes(known, one.mass_matrix[np.ix_(k, k)], stiffness, excitation, known["dofs"])
    )
    scale = np.abs(theirs).max(axis=0)
    assert (np.abs(mine - theirs) <= 0.05 * theirs + 0.01 * scale).all(), (mine, theirs)


def test_two_spheres_feel_each_other_as_in_capytaine():
    known = CAPYTAINE["two spheres"]
    mesh = trimesh.creation.icosphere(2)
    mesh.apply_scale(hulls.RADIUS * (4.0 / 3.0 * np.pi / mesh.volume) ** (1.0 / 3.0))
    pair = [
        wetted_hull(
            mesh.triangles + np.array([side * hulls.APART / 2, 0.0, 0.0]), height=0.0, panels=100
        )
        for side in (-1.0, 1.0)
    ]
    ours = coefficients([body(pair[0]), body(pair[1])], known["omega"], density=RHO)
    k = [0, 2, 6, 8]
    for name in ("added_mass", "radiation_damping"):
        mine, theirs = ours[name].values[:, k][:, :, k], np.array(known[name])
        scale = np.sqrt(
            np.einsum("wi,wj->wij", *[np.diagonal(np.abs(theirs), axis1=1, axis2=2)] * 2)
        )
        assert (np.abs(mine.swapaxes(1, 2) - theirs) <= 0.1 * scale.max(axis=0)).all(), name


def test_what_a_hull_radiates_is_what_its_motion_loses():
    """Damping by the pressure on the hull, and by the waves at infinity: two ways that share no formula."""
    omega = np.sqrt(G * np.array([0.3, 0.8, 1.5]) / hulls.RADIUS)
    influence = hull_influence(sphere(2))
    radiated, _, _, outward = potentials(influence, omega, gravity=G)
    pressure = np.imag(-influence.loads @ radiated) * omega[:, None, None]
    for i in (0, 2):
        np.testing.assert_allclose(pressure[:, i, i], outward[:, i, i], rtol=0.04)


def test_wave_force_and_damping_obey_haskind():
    """B = k / (8 pi rho g c_g) int |X|^2 over directions, c_g = g / (2 omega)."""
    omega = np.sqrt(G * 0.8 / hulls.RADIUS)
    directions = 2.0 * np.pi * np.arange(12) / 12
    found = coefficients([body(sphere(2))], [omega], directions=tuple(directions), density=RHO)
    k = omega**2 / G
    for i in (0, 2):
        force = np.abs(found.excitation_force.values[0, :, i]) ** 2
        haskind = k / (8.0 * np.pi * RHO * G * G / (2.0 * omega)) * 2.0 * np.pi * force.mean()
        assert haskind == pytest.approx(found.radiation_damping.values[0, i, i], rel=0.04)


def test_no_irregular_frequencies_up_to_16_radians_a_second():
    """Without the lid the barge's inner water resonates at 11 rad/s, and added mass jumps there."""
    omega = np.linspace(8.0, 16.0, 33)
    found = coefficients([body(barge())], omega, density=RHO)
    for i in (2, 4):
        added = found.added_mass.values[:, i, i]
        damping = found.radiation_damping.values[:, i, i]
        assert (damping > 0.0).all()
        assert np.abs(np.diff(added, 2)).max() < 0.01 * added.max()
        assert np.abs(np.diff(damping, 2)).max() < 0.03 * damping.max()


def test_modes_resolve_the_dispersion_relation_of_any_depth():
    omega = np.array([0.5, 3.0, 12.0])
    for depth in (0.1, 2.0, np.inf):
        k = wavenumber(omega, depth=depth, gravity=G)
        np.testing.assert_allclose(frequency(k, depth=depth, gravity=G), omega, rtol=1e-12)


def test_a_hump_of_water_spreads_as_cauchy_and_poisson_have_it():
    """The modes of an unbounded sea against the integral int k exp(-k^2 b^2 / 2) J0(0) cos(omega t) dk."""
    modes = surface_modes(shortest=0.25, reach=0.3)
    k, width = modes.wavenumbers, 0.15
    start = np.exp(-0.5 * (k * width) ** 2)[modes.ring] * 2.0 * np.pi * width**2
    real_k = np.linspace(1e-4, 60.0, 40001)
    for time in (0.0, 0.4, 1.5, 6.0):
        turned = start * np.exp(-1j * modes.frequencies[modes.ring] * time)
        exact = width**2 * np.trapezoid(
            real_k * np.exp(-0.5 * (real_k * width) ** 2) * np.cos(np.sqrt(G * real_k) * time),
            real_k,
        )
        assert modes.elevation(turned, [[0.0, 0.0]])[0] == pytest.approx(exact, abs=8e-3)


@pytest.mark.parametrize(("make", "tolerance"), [(sphere, 0.03), (ship, 0.05)])
def test_tables_in_time_have_the_coefficients_of_the_frequency_domain(make, tolerance):
    hull = make() if make is not sphere else sphere(2)
    table = radiation_table(hull, body_modes((hull,)), density=RHO)
    width = np.sqrt(hull.moments()[0] / np.pi)
    omega = np.sqrt(G * np.array([0.3, 0.7, 1.2]) / width)
    added, damping = table_coefficients(table, omega)
    known = coefficients([body(hull)], omega, density=RHO)
    for i in (2, 4) if make is ship else (0, 2):
        np.testing.assert_allclose(added[:, i, i], known.added_mass.values[:, i, i], rtol=tolerance)
        scale = known.radiation_damping.values[:, i, i].max()
        assert (
            np.abs(damping[:, i, i] - known.radiation_damping.values[:, i, i]).max()
            < tolerance * scale
        )


def test_known_waves_turn_with_the_body():
    """A body that turns by 40 degrees in waves from 40 degrees feels what it felt before."""
    hull = ship()
    table = radiation_table(hull, body_modes((hull,)), density=RHO)
    k = np.array([4.0])
    omega = np.sqrt(G * k)
    ahead = known_waves(table, k, omega, np.array([0.0])).at(0.0)
    turned = known_waves(table, k, omega, np.array([0.7])).at(0.7)
    for a, b in zip(ahead, turned, strict=True):
        np.testing.assert_allclose(a, b, atol=5e-3 * np.abs(a).max())


def test_bad_frequencies_are_refused_in_one_line():
    with pytest.raises(ValueError, match=r"omega is .*: give finite angular frequencies above 0"):
        coefficients([body(sphere(2))], [0.0])
