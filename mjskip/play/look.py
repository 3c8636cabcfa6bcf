"""How the page looks: light and water, where the camera stands, headline, table and plot."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mjskip._typing import Array, SingleArray
from mjskip.draw.forces import loads_at
from mjskip.hydro.stone import Stone
from mjskip.play.player import Frame
from mjskip.play.surface import EVEN_VERTICES, STEP, DrawnWater
from mjskip.play.thrown import ThrowResult
from mjskip.throws.scene import Scene
from mjskip.throws.throw import Throw
from mjskip.throws.trajectory import Trajectory, pose_at

FOLLOW, WHOLE = "follow the stone", "the whole throw"
VIEWS = (FOLLOW, WHOLE)

VISER = (
    "token",
    "websocket",
    "showStats",
    "fixedDpr",
    "darkMode",
    "logCamera",
    "forceOrbitOriginTool",
)
"""Parts of an address that are the server's own, and no settings."""

HAZE = (150, 172, 182)
WATER = (36, 128, 158)
STONES = ((122, 112, 101), (150, 104, 84), (96, 108, 118))
TRAIL = (255, 246, 214)
TRAIL_PIECES = 160
"""Straight pieces of the drawn path."""

PLOT_POINTS = 300

WAVE_EXAGGERATION = 2.5
"""Times that waves are drawn as high as they are, so that rings are seen; the page says so."""

MARK, FORCES = (255, 214, 140), {"water": (70, 160, 255), "air": (250, 250, 250)}
RING = 0.1
"""Radius of the mark of a touch [m]."""


# The lake ---------------------------------------------------------------------------------------


def lake(client: Any, water: DrawnWater, stones: Mapping[str, Stone]) -> dict[str, Any]:
    """Put light, water and stones into a client's scene; the nodes that move, by name.

    Everything hangs on one frame that moves against the stone when the view follows it, so that the
    camera stays the user's.
    """
    scene = client.scene
    scene.configure_environment_map(
        "park", background=True, background_blurriness=0.05, environment_intensity=0.4
    )
    scene.configure_default_lights(False)
    scene.configure_fog(6.0, 60.0, color=HAZE)
    # low and beyond the stone: matte water shows its slopes by it, bright towards the sun
    scene.add_light_directional(
        "/sun", color=(255, 242, 220), intensity=8.0, position=(-4.0, 7.0, 0.75)
    )
    scene.add_light_directional(
        "/sky", color=(120, 170, 255), intensity=0.6, position=(4.0, -5.0, 3.0)
    )
    nodes: dict[str, Any] = {"client": client}
    nodes["lake"] = scene.add_frame("/lake", show_axes=False)
    nodes["water"] = scene.add_mesh_simple(
        "/lake/water",
        water.vertices(None, middle=(0.0, 0.0)),
        water.faces,
        color=WATER,
        cast_shadow=False,
        receive_shadow=False,
    )
    for number, (name, stone) in enumerate(stones.items()):
        nodes[f"stone {name}"] = scene.add_mesh_simple(
            f"/lake/stone_{number}",
            stone.vertices.astype(np.float32),
            stone.faces.astype(np.uint32),
            color=STONES[number % len(STONES)],
            flat_shading=True,
        )
        nodes[f"trail {name}"] = scene.add_line_segments(
            f"/lake/trail_{number}",
            np.zeros((TRAIL_PIECES, 2, 3), np.float32),
            TRAIL,
            thickness=2.0,
            thickness_units="screen",
            visible=False,
        )
    for kind, colour in FORCES.items():
        nodes[f"force {kind}"] = scene.add_line_segments(
            f"/lake/force_{kind}", np.zeros((3, 2, 3), np.float32), colour, thickness=5.0,
            thickness_units="screen", visible=False,
        )  # fmt: skip
    nodes["touches"], nodes["scale"] = [], []
    aim(client, FOLLOW, None)
    return nodes


def aim(client: Any, view: str, thrown: ThrowResult | None) -> None:
    """Put the camera where this view begins; from there it is the user's."""
    camera = client.camera
    camera.up_direction = (0.0, 0.0, 1.0)
    if view == FOLLOW or thrown is None:
        camera.position, at = (0.75, -1.45, 0.62), (0.02, 0.0, 0.03)
    else:
        far = max(0.5 * _length(thrown), 1.5)
        camera.position, at = (0.5 * far, -1.75 * far, 0.6 * far), (0.38 * far, 0.0, 0.0)
    camera.look_at = at
    camera.fov = 0.75


def grid(view: str, thrown: ThrowResult) -> DrawnWater:
    """Vertices to draw the water with: spread along the whole throw if that is the view."""
    return (
        DrawnWater()
        if view == FOLLOW
        else DrawnWater(max(STEP, 1.2 * _length(thrown) / EVEN_VERTICES[0]))
    )


def _length(thrown: ThrowResult) -> float:
    return float(np.ptp(thrown.chosen.position[:, 0]))


def place_throw(nodes: dict[str, Any], thrown: ThrowResult) -> None:
    """Make ready for a run: its stones, no marks, no trails."""
    _forget_touches(nodes)
    for name, stone in thrown.scene.stones.items():
        node = nodes[f"stone {name}"]
        if node.vertices.shape != stone.vertices.shape or not np.allclose(
            node.vertices, stone.vertices, atol=1e-6
        ):
            node.vertices = stone.vertices.astype(np.float32)
            node.faces = stone.faces.astype(np.uint32)
        nodes[f"trail {name}"].visible = False
    x, y, _ = thrown.chosen.position[0].tolist()
    draw_scale(nodes, (x, y), _length(thrown))


def still(nodes: dict[str, Any], water: DrawnWater, scene: Scene, throw: Throw) -> None:
    """Still water and every stone in the hand, level with how it will leave it."""
    _forget_touches(nodes)
    starts = {
        name: (throw if name == scene.body else scene.throws[name]).state(stone)
        for name, stone in scene.stones.items()
    }
    for number, (name, start) in enumerate(starts.items()):
        nodes[f"trail {name}"].visible = False
        node = nodes[f"stone {name}"]
        node.vertices = scene.stones[name].vertices.astype(np.float32)
        node.faces = scene.stones[name].faces.astype(np.uint32)
        x, y, z = start.position
        node.position = (x, y + 0.3 * number, z)
        node.wxyz = tuple(start.q)
    nodes["lake"].position = (0.0, 0.0, 0.0)
    nodes["water"].position = (0.0, 0.0, 0.0)
    nodes["water"].vertices = water.vertices(None, middle=(0.0, 0.0))
    for kind in FORCES:
        nodes[f"force {kind}"].visible = False
    draw_scale(nodes, (0.0, 0.0), 12.0)


def draw_scale(nodes: dict[str, Any], start: tuple[float, float], length: float) -> None:
    """A tick on the water at every metre of a throw along x, numbered."""
    for node in nodes["scale"]:
        node.remove()
    scene, (x, y) = nodes["client"].scene, start
    metres = range(math.ceil(length) + 2)
    ends = [[(x + k, y - 0.55, 0.012), (x + k, y - 0.40, 0.012)] for k in metres]
    ends.append([(x, y - 0.55, 0.012), (x + metres[-1], y - 0.55, 0.012)])
    nodes["scale"] = [
        scene.add_line_segments(
            "/lake/scale", np.array(ends, np.float32), MARK, thickness=2.0, thickness_units="screen"
        )
    ]
    for k in metres[1:]:
        place = (x + float(k), y - 0.62, 0.02)
        nodes["scale"].append(
            scene.add_label(f"/lake/scale_{k}", f"{k} m", position=place, font_screen_scale=0.7)
        )


def draw(
    nodes: dict[str, Any], water: DrawnWater, frame: Frame, *, view: str, forces: bool = False
) -> None:
    """Put one moment into the scene: the newest surface, the stones, their paths, the forces."""
    thrown = frame.thrown
    x, y, _ = pose_at(thrown.chosen, frame.time)[
        0
    ].tolist()  # held when the run is over: rings are there
    if view != FOLLOW:
        x, y, _ = (0.5 * (thrown.chosen.position[0] + thrown.chosen.position[-1])).tolist()
    place = water.place(x, y)
    surface = water.vertices(frame.water, middle=place)
    surface[:, 2] *= WAVE_EXAGGERATION
    nodes["water"].vertices = surface
    nodes["water"].position = (*place, 0.0)
    nodes["lake"].position = (-x, -y, 0.0)
    for name, (position, attitude) in frame.poses.items():
        stone = nodes[f"stone {name}"]
        stone.position, stone.wxyz = tuple(position), tuple(attitude)
        trail = nodes[f"trail {name}"]
        trail.points = path(thrown.flights[name], until=frame.time)
        trail.visible = True
    body, flight = thrown.scene.body, thrown.chosen
    shown = forces and frame.time <= flight.time[-1]
    arrows = loads_at(flight, thrown.scene.stones[body], frame.time).arrows if shown else []
    for kind, colour in FORCES.items():
        node = nodes[f"force {kind}"]
        found = [arrow(a, b) for a, b, drawn in arrows if drawn == colour]
        node.visible = bool(found)
        if found:
            node.points = found[0]


def arrow(start: Array, tip: Array) -> SingleArray:
    """A line with a head as pieces (3, 2, 3) [m]."""
    along = tip - start
    across = np.cross(along, [0.0, 1.0, 0.0])
    across *= 0.12 * np.linalg.norm(along) / max(float(np.linalg.norm(across)), 1e-9)
    neck = start + 0.75 * along
    return np.array([[start, tip], [tip, neck + across], [tip, neck - across]], np.float32)


def path(flight: Trajectory, *, until: float) -> SingleArray:
    """The way so far as pieces (TRAIL_PIECES, 2, 3) [m]."""
    rows = np.linspace(0, max(int(np.searchsorted(flight.time, until)), 1), TRAIL_PIECES + 1)
    points = flight.position[np.minimum(rows.astype(np.intp), len(flight.time) - 1)]
    return np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)


def mark_touches(nodes: dict[str, Any], frame: Frame) -> None:
    """A ring and a number at the place of every touch until now."""
    contacts = frame.thrown.chosen.contacts[: frame.touches]
    if len(nodes["touches"]) > 2 * len(contacts):
        _forget_touches(nodes)
    for number in range(len(nodes["touches"]) // 2 + 1, len(contacts) + 1):
        x, y, _ = contacts[number - 1].entry.position
        turn = np.linspace(0.0, 2.0 * math.pi, 41)
        ring = np.column_stack(
            [x + RING * np.cos(turn), y + RING * np.sin(turn), 0.0 * turn + 0.012]
        )
        nodes["touches"].append(
            nodes["client"].scene.add_line_segments(
                f"/lake/ring_{number}", np.stack([ring[:-1], ring[1:]], axis=1).astype(np.float32),
                MARK, thickness=3.0, thickness_units="screen",
            )
        )  # fmt: skip
        nodes["touches"].append(
            nodes["client"].scene.add_label(
                f"/lake/touch_{number}",
                str(number),
                position=(x, y, 0.06),
                anchor="bottom-center",
                font_screen_scale=0.9,
            )
        )


def _forget_touches(nodes: dict[str, Any]) -> None:
    for label in nodes["touches"]:
        label.remove()
    nodes["touches"] = []


# The panel --------------------------------------------------------------------------------------


def headline(large: str, small_text: str) -> str:
    """The line on top of the panel."""
    return (
        "<div style='padding:.1em .9em .4em'>"
        f"<div style='font-size:1.9em;font-weight:700;color:#0b7285'>{html.escape(large)}</div>"
        f"<div style='opacity:.75;font-size:.9em'>{html.escape(small_text)}</div></div>"
    )


def small(content: str) -> str:
    """A line in small print; the content is HTML."""
    return f"<div style='padding:0 1em;font-size:.82em;opacity:.85'>{content}</div>"


def html_table(rows: Sequence[Sequence[str]]) -> str:
    """A table with headings in its first row."""
    head, *body = rows
    cells = "".join(f"<th style='font-weight:600'>{html.escape(cell)}</th>" for cell in head)
    lines = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in body
    )
    return (
        "<table class='touches' style='width:96%;margin:.2em 2%;font-size:.72em;text-align:right;"
        "font-variant-numeric:tabular-nums;border-spacing:0 .15em'>"
        f"<thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table>"
    )


def side_view(flight: Trajectory) -> tuple[Array, ...]:
    """Distance [m], height [cm] and speed [m/s] for the plot, evenly spaced in time."""
    rows = np.linspace(0, len(flight.time) - 1, min(PLOT_POINTS, len(flight.time))).astype(np.intp)
    away = np.maximum.accumulate(
        flight.position[rows, 0] - flight.position[0, 0]
    )  # uPlot wants it ascending
    return away, 100.0 * flight.position[rows, 2], np.linalg.norm(flight.velocity[rows], axis=1)


def add_plot(gui: Any) -> Any:
    """Path from the side and speed, empty at first."""
    none = np.zeros(2)
    return gui.add_uplot(
        data=(none, none, none),
        series=(
            {"label": "distance m"},
            {"label": "height cm", "stroke": "#0b7285", "width": 2, "scale": "height"},
            {"label": "speed m/s", "stroke": "#e8590c", "width": 1.5, "scale": "speed"},
        ),
        scales={"x": {"time": False}, "height": {}, "speed": {}},
        axes=(
            {"label": "distance (m)", "size": 34, "labelSize": 16},
            {"label": "height (cm)", "scale": "height", "stroke": "#0b7285", "size": 38},
            {"label": "speed (m/s)", "scale": "speed", "stroke": "#e8590c", "side": 1, "size": 38,
             "grid": {"show": False}},
        ),
        legend={"show": False},
        height=190,
        visible=False,
    )  # fmt: skip
