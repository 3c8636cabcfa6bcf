"""Moving water inside MuJoCo's own step: what the plugin does where an instance's surface is `waves` or `deep`.

All that moves is state of the plugin in MjData, from `plugin_stateadr` of the instance on:

    window       level, potential and rate (`mjskip.waves._window_kernels`)
    evaluations  of the force since the surface was last stepped
    placed       0 until the window has been put under its bodies
    disturbed    0 while nothing has pressed on the water, which then needs no step
    ring         of the last four evaluations: number of loads, then their place and vertical force on the water

Every evaluation of the force (four a step for RK4) solves loads and the surface's answer to them at pose and velocity
as they are (`mjskip.waves._coupling_kernels`); the level is that of the step's beginning, and the rate G phi[n-1/2]
that of the last half step, first order in the step. MuJoCo moves the bodies. `advance`, once a step, steps the surface
under the integrator's mean of the loads that it evaluated last: 1/6, 1/3, 1/3, 1/6 of RK4, the last one of others.

A *surface* is a record of this process, see the constants; `arguments` are words.
"""

import math
from typing import Any

import numba
import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, as_ints, as_words, bits, stack_doubles
from mjskip.coupling import _plugin_kernels as plugin
from mjskip.coupling._plugin_kernels import (
    is_head,
    load_body,
    push,
    size,
    wets_below,
)
from mjskip.coupling._record_kernels import RECORD
from mjskip.coupling._table_kernels import doubles, ints
from mjskip.hydro import _block as hydro
from mjskip.hydro._clip_kernels import immersed_part
from mjskip.waves import _coupling_kernels as coupling
from mjskip.waves import _window_kernels as window

# a surface
WATER_SIZE = 0  # doubles of the window's water; 0: still water
STATE_DOUBLES = 1  # of an instance's state
LOAD_RADIUS = 2  # of the bumps that spread loads [m]
PER_AREA = 3  # entries of the response's profile per square metre of distance
PROFILE_SIZE = 4
ARROWS = 5  # length of force arrows [m/N], or 0
MAX_TIMESTEP = 6  # of the window [s]
SURFACE = 7  # then the water, then the profile

SPLIT = RECORD  # of a wet body's record: address of its block with faces no longer than LOAD_RADIUS

EVALUATIONS, PLACED, DISTURBED, TAIL = 0, 1, 2, 3  # of the state, after the window's
STAGES = 4
WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
"""Of RK4's stages."""
MAX_LOADS = 256
"""Loads that are kept of an evaluation; more are added to those at their mean place."""
LOAD = 3  # x, y, force

TOLERANCE = 1e-9
"""Of loads, relative to the greatest."""

RK4 = 1  # mjtIntegrator
SITE = 6  # mjtObj
INSTANCE, CAPABILITY, RECORDS, SCENE, ARGUMENTS = 0, 1, 2, 3, 4


@kernel
def state_size(cells: int) -> int:
    """Doubles of the state of an instance with a window of so many cells a side."""
    return window.STATE + 3 * cells * cells + TAIL + STAGES * (1 + LOAD * MAX_LOADS)


@kernel
def state_of(table: Any, model: int, data: int, instance: int, cells: int) -> Any:
    start = ints(table, model, plugin.PLUGIN_STATEADR)[instance]
    address = as_words(data + table[plugin.PLUGIN_STATE])[0] + 8 * start
    return numba.carray(as_doubles(address), state_size(cells))


@kernel
def water_of(surface: int) -> Any:
    return numba.carray(as_doubles(surface + 8 * SURFACE), int(as_doubles(surface)[WATER_SIZE]))


@kernel
def _profile_of(surface: int) -> Any:
    numbers = as_doubles(surface)
    first = SURFACE + int(numbers[WATER_SIZE])
    return numba.carray(as_doubles(surface + 8 * first), int(numbers[PROFILE_SIZE]))


@kernel
def _block_of(record: int) -> Any:
    """The split block of a wet body."""
    address = bits(as_doubles(record)[SPLIT])
    stride = int(as_doubles(address)[hydro.STRIDE])
    return numba.carray(as_doubles(address), hydro.HEADER + hydro.COLUMNS * stride)


@kernel
def gather(table: Any, model: int, data: int, instance: int, awake_only: bool, scratch: int) -> Any:
    """Wet bodies of an instance: ids and addresses of their records (n, 2), states (n, 18), wrenches (n, 12).

    The wrenches are those of all that moving water leaves alone: air, buoyancy and skin friction of still water.
    """
    below = wets_below(table, model, instance)
    awake = ints(table, data, plugin.BODY_AWAKE)
    count = 0
    bodies = size(table, model, plugin.NBODY)
    for body in range(1, bodies):
        if is_head(table, model, body, instance, below):
            count += 1
    ids, states, wrenches = (
        np.empty((count, 2), np.int64),
        np.empty((count, 18)),
        np.empty((count, 12)),
    )
    found = 0
    state, wrench = as_doubles(scratch), as_doubles(scratch + 8 * plugin.AT_WRENCH)
    for body in range(1, bodies):
        if not is_head(table, model, body, instance, below):
            continue
        if awake_only and awake[body] == plugin.ASLEEP:
            continue
        record = load_body(table, model, data, body, instance, scratch)
        if record == 0:
            continue
        ids[found, 0], ids[found, 1] = body, record
        for i in range(18):
            states[found, i] = state[i]
        for i in range(12):
            wrenches[found, i] = wrench[i]
        found += 1
    return ids[:found], states[:found], wrenches[:found]


@kernel
def _extremes(level: Any, rate: Any, frame: Any, state: Any, radius: float) -> None:
    """Greatest |level| and |rate| under a body into its frame."""
    n = level.shape[0]
    reach = radius / frame[coupling.SPACING] + 1.0
    east = (state[0] - frame[0]) / frame[coupling.SPACING]
    north = (state[1] - frame[1]) / frame[coupling.SPACING]
    highest = fastest = 0.0
    if -reach < east < n + reach and -reach < north < n + reach:
        for i in range(max(0, int(east - reach)), min(n, int(east + reach) + 1)):
            for j in range(max(0, int(north - reach)), min(n, int(north + reach) + 1)):
                highest = max(highest, abs(level[i, j]))
                fastest = max(fastest, abs(rate[i, j]))
    frame[coupling.HIGHEST], frame[coupling.FASTEST] = highest, fastest


@kernel
def _frame_of(water: Any, state: Any) -> Any:
    frame = np.zeros(coupling.FRAME)
    frame[0] = state[window.FIRST_I] * water[window.SPACING]
    frame[1] = state[window.FIRST_J] * water[window.SPACING]
    frame[coupling.SPACING] = water[window.SPACING]
    return frame


@kernel
def couple(surface: int, state: Any, ids: Any, states: Any, wrenches: Any, timestep: float) -> Any:
    """Loads on all wet bodies at once, added to their wrenches (n, 12): faces and loads (m,), m."""
    numbers, water, profile = as_doubles(surface), water_of(surface), _profile_of(surface)
    n = int(water[window.CELLS])
    level, rate = window.plane(state, n, 0), window.plane(state, n, 2)
    frame = _frame_of(water, state)
    radius = numbers[LOAD_RADIUS]
    room = 0
    for b in range(ids.shape[0]):
        block = _block_of(ids[b, 1])
        # a position that is not finite must reach the sums
        if not states[b, 2] > block[hydro.RADIUS] + 1.0:
            room += int(block[hydro.N_FACES])
    faces = np.empty((room, coupling.FACE))
    count = 0
    for b in range(ids.shape[0]):
        block = _block_of(ids[b, 1])
        if not states[b, 2] > block[hydro.RADIUS] + 1.0:
            _extremes(level, rate, frame, states[b], block[hydro.RADIUS] + radius)
            count = coupling.find_faces(block, states[b], frame, level, b, faces, count)
    loads = np.empty(count)
    if count == 0:
        return faces, loads, 0
    side = math.floor(2.0 * radius / frame[coupling.SPACING]) + 1
    spots = np.empty((count, coupling.SPOT + side * side))
    speeds = np.empty(count)
    coupling.spread_bumps(faces, count, frame, radius, np.ones((n, n), np.uint8), side, spots)
    count = coupling.free_speeds(faces, count, states, spots, side, rate, speeds)
    matrix = np.empty((count, count))
    factor = timestep / (
        2.0 * water[window.DENSITY] * (1.0 + 0.5 * timestep * water[window.DAMPING])
    )
    coupling.surface_response_by_distance(faces, count, profile, numbers[PER_AREA], factor, matrix)
    coupling.solve(faces, count, matrix, TOLERANCE, coupling.MAX_SWEEPS, speeds, loads)
    coupling.add_wrench(faces, count, loads, wrenches)
    return faces, loads, count


@kernel
def _keep_loads(state: Any, cells: int, faces: Any, loads: Any, count: int) -> None:
    """Write the vertical forces on the water into the next slot of the ring."""
    tail = state[window.STATE + 3 * cells * cells :]
    slot = int(tail[EVALUATIONS]) % STAGES
    tail[EVALUATIONS] += 1.0
    ring = tail[TAIL + slot * (1 + LOAD * MAX_LOADS) :]
    kept = 0
    for k in range(count):
        force = -loads[k] * faces[k, coupling.NORMAL + 2]
        if force == 0.0:
            continue
        tail[DISTURBED] = 1.0
        at = 1 + LOAD * (kept % MAX_LOADS)
        if kept < MAX_LOADS:
            ring[at], ring[at + 1] = faces[k, coupling.POINT_X], faces[k, coupling.POINT_Y]
            ring[at + 2] = force
        else:
            total = ring[at + 2] + force
            part = force / total if total != 0.0 else 0.0
            ring[at] += part * (faces[k, coupling.POINT_X] - ring[at])
            ring[at + 1] += part * (faces[k, coupling.POINT_Y] - ring[at + 1])
            ring[at + 2] = total
        kept += 1
    ring[0] = min(kept, MAX_LOADS)


@kernel
def _place(water: Any, state: Any, table: Any, model: int, data: int, instance: int) -> None:
    """Put the window under the middle of its bodies if it has no place yet, else let it follow them."""
    below = wets_below(table, model, instance)
    place = doubles(table, data, plugin.XPOS)
    x = y = 0.0
    count = 0
    for body in range(1, size(table, model, plugin.NBODY)):
        if is_head(table, model, body, instance, below):
            x += place[3 * body]
            y += place[3 * body + 1]
            count += 1
    if count == 0 or not (abs(x) < 1e12 and abs(y) < 1e12):
        return
    cells = int(water[window.CELLS])
    tail = state[window.STATE + 3 * cells * cells :]
    if tail[PLACED] == 0.0:
        middle = 0.5 * (cells - 1)
        state[window.FIRST_I] = np.rint(x / count / water[window.SPACING] - middle)
        state[window.FIRST_J] = np.rint(y / count / water[window.SPACING] - middle)
        tail[PLACED] = 1.0
    else:
        window.follow(water, state, x / count, y / count)


@kernel
def timestep_of(table: Any, model: int) -> Any:
    return as_doubles(model + table[plugin.TIMESTEP])[0]


@kernel
def _push_sum(
    table: Any, model: int, data: int, body: int, state: Any, wrench: Any, scratch: int
) -> None:
    """qfrc_passive of a state (18,) and a wrench (12,)."""
    place, load = as_doubles(scratch), as_doubles(scratch + 8 * plugin.AT_WRENCH)
    for i in range(18):
        place[i] = state[i]
    for i in range(12):
        load[i] = wrench[i]
    push(table, model, data, body, scratch)


def moving_compute(model: int, data: int, arguments: int) -> None:
    """Force on all bodies of an instance, or its sensors."""
    table = as_words(plugin.root_address())
    words = as_words(arguments)
    instance, capability, surface = words[INSTANCE], words[CAPABILITY], words[RECORDS]
    scratch = stack_doubles(plugin.LOAD_SCRATCH)
    water = water_of(surface)
    cells = int(water[window.CELLS])
    state = state_of(table, model, data, instance, cells)
    if state[window.STATE + 3 * cells * cells + PLACED] == 0.0:
        _place(water, state, table, model, data, instance)
    timestep = timestep_of(table, model)
    if capability & plugin.PASSIVE:
        ids, states, wrenches = gather(table, model, data, instance, True, scratch)
        faces, loads, count = couple(surface, state, ids, states, wrenches, timestep)
        _keep_loads(state, cells, faces, loads, count)
        for b in range(ids.shape[0]):
            if _is_finite(wrenches[b]):
                _push_sum(table, model, data, ids[b, 0], states[b], wrenches[b], scratch)
            else:
                plugin.warn(data, ids[b, 0])
    if capability & plugin.SENSOR and _has_sensors(table, model, instance):
        ids, states, wrenches = gather(table, model, data, instance, False, scratch)
        couple(surface, state, ids, states, wrenches, timestep)
        names = ints(table, model, plugin.SENSOR_PLUGIN)
        for sensor in range(size(table, model, plugin.NSENSOR)):
            if names[sensor] == instance:
                _sense(table, model, data, instance, sensor, surface, state, ids, states, wrenches)


@kernel
def _has_sensors(table: Any, model: int, instance: int) -> bool:
    names = ints(table, model, plugin.SENSOR_PLUGIN)
    found = 0
    for sensor in range(size(table, model, plugin.NSENSOR)):
        found += int(names[sensor] == instance)
    return found > 0


@kernel
def _is_finite(row: Any) -> bool:
    total = 0.0
    for i in range(row.size):
        total += row[i]
    return bool(np.isfinite(total))


@kernel
def _sense(
    table: Any, model: int, data: int, instance: int, sensor: int, surface: int,
    state: Any, ids: Any, states: Any, wrenches: Any,
) -> None:  # fmt: skip
    """One sensor: of all bodies in turn, or level and vertical speed of the surface at a site."""
    out = as_words(data + table[plugin.SENSORDATA])[0]
    out += 8 * ints(table, model, plugin.SENSOR_ADR)[sensor]
    reading = as_doubles(out)
    water = water_of(surface)
    cells = int(water[window.CELLS])
    frame, level = _frame_of(water, state), window.plane(state, cells, 0)
    below = wets_below(table, model, instance)
    heads = 0
    for body in range(1, size(table, model, plugin.NBODY)):
        if is_head(table, model, body, instance, below):
            heads += 1
    for i in range(plugin.READING * heads):
        reading[i] = 0.0
    if ints(table, model, plugin.SENSOR_OBJTYPE)[sensor] == SITE:
        site = 3 * ints(table, model, plugin.SENSOR_OBJID)[sensor]
        place = doubles(table, data, plugin.SITE_XPOS)
        rate = window.plane(state, cells, 2)
        reading[0] = coupling.elevation(frame, level, place[site], place[site + 1])
        reading[1] = coupling.elevation(frame, rate, place[site], place[site + 1])
        return
    at = b = 0
    for body in range(1, size(table, model, plugin.NBODY)):
        if not is_head(table, model, body, instance, below):
            continue
        if b < ids.shape[0] and ids[b, 0] == body:
            for i in range(6):
                reading[at + i] = wrenches[b, i] + wrenches[b, 6 + i]
            reading[at + 6] = _wetted_area(_block_of(ids[b, 1]), states[b], frame, level)
            b += 1
        at += plugin.READING


@kernel
def _wetted_area(block: Any, state: Any, frame: Any, level: Any) -> float:
    """Area of a body below the moving surface, loaded or not."""
    n = int(block[hydro.STRIDE])
    total = 0.0
    heights = np.empty(3)
    for k in range(int(block[hydro.N_FACES])):
        a = hydro.HEADER + k
        for c in range(3):
            x, y, z = block[a + 3 * c * n], block[a + (3 * c + 1) * n], block[a + (3 * c + 2) * n]
            east = state[0] + state[3] * x + state[4] * y + state[5] * z
            north = state[1] + state[6] * x + state[7] * y + state[8] * z
            up = state[2] + state[9] * x + state[10] * y + state[11] * z
            heights[c] = up - coupling.elevation(frame, level, east, north)
        fraction, _, _, _ = immersed_part(
            0.0, 0.0, 0.0, heights[0], 0.0, 0.0, 0.0, heights[1], 0.0, 0.0, 0.0, heights[2]
        )
        total += fraction * block[hydro.HEADER + hydro.AREA * n + k]
    return total


def moving_advance(model: int, data: int, arguments: int) -> None:
    """Step the surface under the mean of the loads of the step's evaluations, and let it follow its bodies."""
    table = as_words(plugin.root_address())
    words = as_words(arguments)
    instance, surface = words[INSTANCE], words[RECORDS]
    numbers, water = as_doubles(surface), water_of(surface)
    cells = int(water[window.CELLS])
    state = state_of(table, model, data, instance, cells)
    tail = state[window.STATE + 3 * cells * cells :]
    timestep = timestep_of(table, model)
    parts = max(1, math.ceil(timestep / (0.95 * numbers[MAX_TIMESTEP])))
    stages = int(min(tail[EVALUATIONS], 1e9))
    integrator = as_ints(model + table[plugin.INTEGRATOR])[0]
    last = (stages - 1) % STAGES if stages > 0 else 0
    staged = integrator == RK4 and stages >= STAGES
    if staged and _mean_of_stages(state, cells, last, 0.5 * numbers[LOAD_RADIUS]):
        staged = False
    if tail[DISTURBED] == 0.0:
        parts = 0
    for _ in range(parts):
        window.relax(water, state, timestep / parts)
        if staged:
            for stage in range(STAGES):
                slot = (last + 1 + stage) % STAGES
                _press_ring(numbers, water, state, slot, WEIGHTS[stage], timestep / parts)
        elif stages > 0:
            _press_ring(numbers, water, state, last, 1.0, timestep / parts)
        window.flow(water, state, timestep / parts)
    tail[EVALUATIONS] = 0.0
    _place(water, state, table, model, data, instance)


@kernel
def _mean_of_stages(state: Any, cells: int, last: int, near: float) -> bool:
    """WEIGHTS of the four slots of the ring into the last one, if all have the same faces; whether they have.

    They are the same where all slots have as many loads, at places nearer than `near` in turn. Forces are then added
    at their mean place.
    """
    ring = state[window.STATE + 3 * cells * cells + TAIL :]
    width = 1 + LOAD * MAX_LOADS
    count = int(ring[last * width])
    for slot in range(STAGES):
        if int(ring[slot * width]) != count:
            return False
        for k in range(count):
            at, other = last * width + 1 + LOAD * k, slot * width + 1 + LOAD * k
            if abs(ring[other] - ring[at]) + abs(ring[other + 1] - ring[at + 1]) > near:
                return False
    for k in range(count):
        for i in range(LOAD):
            total = 0.0
            for stage in range(STAGES):
                slot = (last + 1 + stage) % STAGES
                total += WEIGHTS[stage] * ring[slot * width + 1 + LOAD * k + i]
            ring[last * width + 1 + LOAD * k + i] = total
    return True


@kernel
def _press_ring(
    numbers: Any, water: Any, state: Any, slot: int, weight: float, duration: float
) -> None:
    """phi -= weight dt p / rho of the loads in one slot of the ring."""
    cells = int(water[window.CELLS])
    ring = state[window.STATE + 3 * cells * cells + TAIL + slot * (1 + LOAD * MAX_LOADS) :]
    count = int(ring[0])
    if count == 0:
        return
    frame = _frame_of(water, state)
    side = math.floor(2.0 * numbers[LOAD_RADIUS] / frame[coupling.SPACING]) + 1
    faces = np.empty((count, coupling.FACE))
    spots = np.empty((count, coupling.SPOT + side * side))
    everywhere = np.ones((cells, cells), np.uint8)
    potential = window.plane(state, cells, 1)
    area = water[window.SPACING] * water[window.SPACING]
    scale = (
        -weight
        * duration
        / (area * water[window.DENSITY] * (1.0 + 0.5 * duration * water[window.DAMPING]))
    )
    for k in range(count):
        faces[k, coupling.POINT_X] = ring[1 + LOAD * k]
        faces[k, coupling.POINT_Y] = ring[2 + LOAD * k]
    coupling.spread_bumps(faces, count, frame, numbers[LOAD_RADIUS], everywhere, side, spots)
    for k in range(count):
        coupling.add_spot(spots[k], side, scale * ring[3 + LOAD * k], potential)
