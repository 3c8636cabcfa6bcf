"""Floating bodies inside MuJoCo: every figure that docs/afloat.md quotes, in one file.

    python scripts/validation/afloat.py [FILE.json]        # some two minutes of processor time

Decays against Cummins' equation with Capytaine's coefficients, responses in regular waves, what stays at rest, the orbit of
a speck, the balance of energy, contacts and a mooring at two time steps, ten times the body's mass of added mass.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import mjskip
from mjskip.coupling.loading import load_model
from mjskip.coupling.plugin import plugin_surface, register_plugin
from mjskip.hydro.radiation import table_coefficients
from mjskip.hydro.seas import Sea
from mjskip.throws.scene import shipped_scenes

CARRIES = '<plugin instance="sea"/>'
SPHERE = f'<body><freejoint/><geom type="sphere" size=".15" mass="7.0686"/>{CARRIES}</body>'
DISC = f'<body><freejoint/><geom type="cylinder" size=".15 .04" mass="1.4137"/>{CARRIES}</body>'
BARGE = (
    '<body name="barge"><freejoint/><geom type="box" size=".5 .2 .1" mass="{}"/>'
    + CARRIES
    + "</body>"
)
BOX = (
    '<body name="box" pos="0.1 0 0.13"><freejoint/>'
    '<geom type="box" size=".05 .05 .03" mass="2" friction="0.3"/></body>'
)


def model(
    bodies: str, *, sea: str = "", timestep: float = 0.002, keys: str = "", integrator: str = "implicitfast"
) -> mujoco.MjModel:  # fmt: skip
    """Bodies that radiate."""
    register_plugin()
    words = f'<config key="sea" value="{sea}"/>' if sea else ""
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{timestep}" integrator="{integrator}"/><extension>'
        '<plugin plugin="mjskip.water"><instance name="sea"><config key="preset" value="floating"/>'
        f'<config key="radiation" value="true"/>{keys}{words}</instance></plugin></extension>'
        f"<worldbody>{bodies}</worldbody></mujoco>"
    )


def followed(
    compiled: mujoco.MjModel, seconds: float, *, start: Any = None, each: Any = None
) -> tuple[mujoco.MjData, Any]:
    """Data after a time, and what `each(data)` said after every step (qpos if None)."""
    data = mujoco.MjData(compiled)
    if start is not None:
        start(data)
    rows = []
    for _ in range(round(seconds / compiled.opt.timestep)):
        mujoco.mj_step(compiled, data)
        rows.append(data.qpos.copy() if each is None else each(data))
    return data, np.array(rows)


def decay(body: str, by: float) -> dict[str, list[float]]:
    """First trough and peak, as a share of the start, and their times [s]."""
    compiled = model(body)
    rest = plugin_surface(compiled).rests[0].height
    _, path = followed(compiled, 0.9, start=lambda d: d.qpos.__setitem__(2, rest + by))
    z = (path[:, 2] - rest) / by
    turns = np.flatnonzero(np.diff(z)[1:] * np.diff(z)[:-1] <= 0.0) + 1
    return {
        "time": [round(0.002 * (t + 1), 3) for t in turns[:2].tolist()],
        "height": [round(float(v), 4) for v in z[turns[:2]]],
    }


def responses() -> dict[str, float]:
    """Heave of the sphere over the amplitude of a regular wave, by ka."""
    found = {}
    for ka in (0.6, 1.0, 1.2, 1.6):
        omega = math.sqrt(9.81 * ka / 0.15)
        compiled = model(SPHERE, sea=f"height=0.004 period={2.0 * math.pi / omega}", timestep=0.004)
        _, path = followed(compiled, 12.0)
        count = round(4 * 2.0 * math.pi / omega / 0.004)
        tail = path[-count:, 2] - path[-count:, 2].mean()
        swing = 2.0 * abs(np.mean(tail * np.exp(1j * omega * 0.004 * np.arange(count))))
        found[f"{ka:g}"] = round(float(swing / 0.002), 4)
    return found


def at_rest() -> dict[str, float]:
    """The barge left alone for 10 s."""
    compiled = model(BARGE.format(40))
    rest = plugin_surface(compiled).rests[0].height
    data, _ = followed(compiled, 10.0, start=lambda d: d.qpos.__setitem__(2, rest))
    return {
        "drift [m]": float(np.linalg.norm(data.qpos[:2])),
        "speed [m/s]": float(np.abs(data.qvel).max()),
    }


def speck() -> dict[str, float]:
    """Greatest distance of a sunk neutral ball from the orbit of its water, over the height of the orbit."""
    found = {}
    for height in (0.01, 0.05):
        mass = 1000 * 4 / 3 * math.pi * 0.02**3
        ball = f'<body pos="0 0 -.4"><freejoint/><geom type="sphere" size=".02" mass="{mass}"/>{CARRIES}</body>'
        compiled = model(ball, sea=f"height={height} period=2")
        sea, place = Sea.regular(height=height, period=2.0), np.array([[0.0, 0.0, -0.4]])

        def begin(data: mujoco.MjData, sea: Sea = sea, place: Any = place) -> None:
            data.qvel[:3] = sea.velocity(place, 0.0)[0]

        _, path = followed(compiled, 2.0, start=begin)
        orbit = []
        for n in range(len(path)):
            middle = place + 0.001 * sea.velocity(place, n * 0.002)
            place = place + 0.002 * sea.velocity(middle, (n + 0.5) * 0.002)
            orbit.append(place[0])
        away = np.abs(path[:, :3] - orbit).max() / np.ptp(np.array(orbit)[:, 2])
        found[f"height {height:g} m"] = round(float(away), 4)
    return found


def energy() -> dict[str, float]:
    """Work of a force that shakes a sphere for 60 s; what its waves took, by the damping of the frequency domain."""
    omega, timestep = 8.0, 0.005
    off = '<config key="skin_friction" value="false"/><config key="air_density" value="0"/>'
    compiled = model(SPHERE, timestep=timestep, keys=off)
    data = mujoco.MjData(compiled)
    steps, work, speed = round(60.0 / timestep), [], []
    for _ in range(steps):
        force = math.sin(omega * data.time)
        data.xfrc_applied[1, 2] = force
        before = data.qvel[2]
        mujoco.mj_step(compiled, data)
        work.append(timestep * force * 0.5 * (before + data.qvel[2]))
        speed.append(data.qvel[2])
    last = round(40 * 2.0 * math.pi / omega / timestep)
    tail, time = np.array(speed[-last:]), timestep * np.arange(last)
    shaken = 2.0 * abs(np.mean(tail * np.exp(1j * omega * time)))
    _, damping = table_coefficients(plugin_surface(compiled).tables[0], omega)
    radiated = 0.5 * damping[0, 2, 2] * shaken**2 * last * timestep
    return {
        "work [J]": float(np.sum(work[-last:])), "radiated [J]": float(radiated),
        "difference": round(float(np.sum(work[-last:]) / radiated - 1.0), 5),
    }  # fmt: skip


def contact(slide: float, sea: str) -> dict[str, float]:
    """A box on the barge's deck: contact force against mass times acceleration, and two time steps."""
    pushes, ends = [], []
    worst = 0.0
    for timestep in (0.002, 0.001):
        compiled = model(BARGE.format(40) + BOX, sea=sea, timestep=timestep)
        force = np.zeros(6)

        def look(data: mujoco.MjData, compiled: Any = compiled, force: Any = force) -> Any:
            total = np.zeros(3)
            for c in range(data.ncon):
                mujoco.mj_contactForce(compiled, data, c, force)
                sign = 1.0 if compiled.geom_bodyid[data.contact[c].geom2] == 2 else -1.0
                total += sign * (data.contact[c].frame.reshape(3, 3).T @ force[:3])
            return [*total, *data.qvel[6:9], *data.qpos[7:10]]

        def begin(data: mujoco.MjData) -> None:
            data.qvel[6] = slide

        _, rows = followed(compiled, 4.0, each=look, start=begin)
        later = round(0.5 / timestep)
        rising = np.diff(rows[:, 3:6], axis=0)[later:] / timestep
        balance = rows[later + 1 :, :3] - 2.0 * (rising + np.array([0.0, 0.0, 9.81]))
        worst = max(worst, float(np.abs(balance).max() / (2.0 * 9.81)))
        pushes.append(rows[later :: round(0.004 / timestep), :3])
        ends.append(rows[-1, 6:])
    return {
        "force less mass times acceleration, of weight": round(worst, 5),
        "force, step halved, of weight": round(
            float(np.abs(pushes[0] - pushes[1]).max() / (2.0 * 9.81)), 5
        ),
        "place, step halved [m]": round(float(np.abs(ends[0] - ends[1]).max()), 6),
    }


def touching() -> dict[str, float]:
    """Two spheres that overlap by 2 cm and part: sum of their momenta, and the step halved."""
    ends, least = [], []
    for timestep in (0.002, 0.001):
        pair = "".join(
            f'<body pos="{x} 0 0"><freejoint/><geom type="sphere" size=".15" mass="7.0686"/>{CARRIES}</body>'
            for x in (-0.14, 0.14)
        )
        data, path = followed(model(pair, timestep=timestep), 2.0)
        ends.append(data.qpos[7])
        least.append(abs(float(data.qpos[0] + data.qpos[7])) / float(data.qpos[7]))
        assert np.isfinite(path).all()
    return {
        "asymmetry": float(max(least)),
        "place, step halved, relative": abs(float(ends[0] / ends[1] - 1.0)),
    }


def mooring() -> dict[str, float]:
    """The shipped buoy for 20 s at two time steps: greatest difference of its path over the path's extent."""
    paths, pulls = [], []
    for timestep in (0.004, 0.002):
        compiled = load_model(shipped_scenes()["buoy"])
        compiled.opt.timestep = timestep

        def look(data: mujoco.MjData) -> Any:
            return [*data.qpos[:3], data.ten_length[0]]

        _, rows = followed(compiled, 20.0, each=look)
        thin = round(0.004 / timestep)
        paths.append(rows[thin - 1 :: thin, :3])
        pulls.append(60.0 * np.maximum(rows[thin - 1 :: thin, 3] - 1.85, 0.0))
    extent = np.ptp(paths[0], axis=0).max()
    return {
        "place, step halved, of the path's extent": float(np.abs(paths[0] - paths[1]).max() / extent),
        "pull, step halved, of the greatest": float(np.abs(pulls[0] - pulls[1]).max() / pulls[0].max()),
    }  # fmt: skip


def light() -> dict[str, float]:
    """A barge of 4 kg let go from 1 cm, by Euler."""
    compiled = model(BARGE.format(4), integrator="Euler")
    surface = plugin_surface(compiled)
    rest = surface.rests[0].height
    _, path = followed(compiled, 5.0, start=lambda d: d.qpos.__setitem__(2, rest + 0.01))
    z = np.abs(path[:, 2] - rest)
    return {
        "added mass over mass": round(float(surface.tables[0].added_mass[2, 2] / 4.0), 2),
        "greatest over first": round(float(z.max() / 0.01), 4),
        "at the end over first": round(float(z[-300:].max() / 0.01), 5),
    }


PARTS: dict[str, Callable[[], Any]] = {
    "decay of a sphere from 30 mm (Cummins with Capytaine: -0.865 at 0.386, 0.630 at 0.770)": lambda: decay(SPHERE, 0.03),
    "decay of a disc from 10 mm (Cummins with Capytaine: -0.733 at 0.299, 0.336 at 0.601)": lambda: decay(DISC, 0.01),
    "heave of a sphere in waves by ka (Capytaine: 1.174, 1.852, 1.250, 0.383)": responses,
    "barge at rest for 10 s": at_rest,
    "speck off its orbit, of the orbit's height": speck,
    "energy over the last 40 periods of 60 s": energy,
    "box resting on a rocking deck": lambda: contact(0.0, "height=0.04 period=1.5"),
    "box sliding over the deck": lambda: contact(0.6, ""),
    "two hulls that touch": touching,
    "moored buoy, 20 s": mooring,
    "added mass over ten times the mass": light,
}  # fmt: skip


def main() -> None:
    found: dict[str, Any] = {"made by": f"mjskip {mjskip.__version__}"}
    for name, part in PARTS.items():
        found[name] = part()
        print(name, found[name], flush=True)
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
