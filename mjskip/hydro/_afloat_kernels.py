"""A floating body in waves at run time, as blocks of doubles: forces, and the step of the surface.

Three blocks (`mjskip.hydro.afloat` packs them):

    surface   header, then the plane waves (k, direction, exp(-i omega dt)) and the sea's waves
    body      header, then tables of its hull against both, and its mesh
    state     time, whether a step is to be made up for, origin (2), amplitudes (re, im), then for every body what
              its hull read last (patterns, lid)

The pressure on the true wetted surface is that of still water and of the sea's waves (Froude-Krylov):

    p = rho g (zeta(x, y, z) - z),  zeta = Re sum_i a_i exp(i theta_i) cosh k_i (z + H) / cosh k_i H

linear over each triangle and cut where it vanishes. What the body scatters and radiates is linear, about its
pose at rest (`radiation`). States are those of `_wrench_kernels`: centre of mass, rotation, velocities, world.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel, vector_kernel
from mjskip.hydro._clip_kernels import column
from mjskip.hydro._radiation_kernels import add_columns, advance_waves, gather, read_rows, scatter

# header of a surface
WAVES, RINGS, GRAVITY, DEPTH, KNOWN, CURRENT_X, CURRENT_Y, TIMESTEP, BODIES, REACH = range(10)
AT_WAVES, AT_KNOWN = 10, 11
SURFACE = 16
WAVE_ROWS = 8  # k (re, im), east, north, turn (re, im), frequency (re, im)
KNOWN_ROWS = 6  # k, omega, east, north, amplitude, phase

# header of a body
ROWS, PATTERNS, LIDS, HARMONICS, RINGS_OF, HEADINGS = range(6)
AT_TURNS, AT_ROWS, AT_COLUMNS, AT_LID, AT_SEEN = range(9, 14)
ADDED = 14  # 36
REST = 50  # 9: rotation from body axes to its level frame, at rest
DENSITY, VERTICES, FACES, AT_VERTICES, AT_FACES, NODES_X, NODES_Y = range(59, 66)
REST_HEIGHT, DRAFT, LENGTH = (
    66,
    67,
    68,
)  # of the centre of mass at rest, depth of the keel, twice the radius [m]
BODY = 69

# state
TIME, PENDING, FRESH, ORIGIN_X, ORIGIN_Y = range(5)
STATE = 5

WET_SHARE = 0.3
"""Of its draft: a hull that is less deep radiates, scatters and drags water in proportion."""
MAX_NODES = 12
LEVELS = 4
COSINES = np.zeros((MAX_NODES + 1, MAX_NODES, MAX_NODES))
"""cos(k pi (a + 1/2) / n) at [n, k, a]: Chebyshev's polynomials at his nodes."""
for _n in range(1, MAX_NODES + 1):
    _k = np.arange(_n)
    COSINES[_n, :_n, :_n] = np.cos(np.pi * np.outer(_k, _k + 0.5) / _n)
TURN = 2.0 * math.pi


@vector_kernel
def phases(
    k_real: Any, k_imag: Any, east: Any, north: Any, x: float, y: float, cosine: Any, sine: Any
) -> None:  # fmt: skip
    """exp(i k (x cos + y sin)) as real and imaginary part, by polynomials that compile to vectors.

    Accurate to 1e-11 for growth up to exp(4).
    """
    for n in range(k_real.shape[0]):
        ahead = x * east[n] + y * north[n]
        angle = k_real[n] * ahead
        turns = np.floor(angle * (1.0 / TURN) + 0.5)
        a = angle - turns * TURN  # within pi of 0
        h = 0.125 * a
        s = h * h
        # sine and 1 - cosine of an eighth of the angle, doubled three times
        si = h * (1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s / 362880.0))))
        vs = s * (
            0.5 + s * (-1.0 / 24.0 + s * (1.0 / 720.0 + s * (-1.0 / 40320.0 + s / 3628800.0)))
        )
        for _ in range(3):
            si, vs = 2.0 * si * (1.0 - vs), 2.0 * si * si
        e = -0.0625 * k_imag[n] * ahead
        g = 1.0 + e * (
            1.0 + e * (0.5 + e * (1.0 / 6.0 + e * (1.0 / 24.0 + e * (1.0 / 120.0 + e * (1.0 / 720.0 + e / 5040.0)))))
        )  # fmt: skip
        g = g * g
        g = g * g
        g = g * g
        g = g * g
        cosine[n] = g * (1.0 - vs)
        sine[n] = g * si


@kernel
def _phases_at(surface: Any, x: float, y: float, cosine: Any, sine: Any) -> None:
    """`phases` of a surface's waves."""
    waves, w = int(surface[WAVES]), int(surface[AT_WAVES])
    phases(
        surface[w : w + waves], surface[w + waves : w + 2 * waves],
        surface[w + 2 * waves : w + 3 * waves], surface[w + 3 * waves : w + 4 * waves],
        x, y, cosine, sine,
    )  # fmt: skip


@kernel
def heading(body: Any, pose: Any) -> float:
    """Heading of a body: the turn about the vertical that brings its pose at rest nearest to its pose [rad]."""
    a = b = c = d = 0.0
    for i in range(3):
        a += pose[3 + i] * body[REST + i]  # Q = R R0'
        b += pose[3 + i] * body[REST + 3 + i]
        c += pose[6 + i] * body[REST + i]
        d += pose[6 + i] * body[REST + 3 + i]
    return math.atan2(c - b, a + d)


@kernel
def tilt(body: Any, pose: Any) -> tuple[float, float, float]:
    """Roll and pitch from the pose at rest, as sines, and the cosine of the angle between the two verticals."""
    x = y = z = 0.0
    for i in range(3):  # last row of Q = R R0'
        x += pose[9 + i] * body[REST + i]
        y += pose[9 + i] * body[REST + 3 + i]
        z += pose[9 + i] * body[REST + 6 + i]
    return y, -x, z


@kernel
def to_heading(yaw: float, pose: Any, current_x: float, current_y: float, out: Any) -> None:
    """Velocity of a body through the water and angular velocity, in its level frame, into out (6)."""
    c, s = math.cos(yaw), math.sin(yaw)
    u, v = pose[12] - current_x, pose[13] - current_y
    out[0], out[1], out[2] = c * u + s * v, c * v - s * u, pose[14]
    out[3], out[4], out[5] = c * pose[15] + s * pose[16], c * pose[16] - s * pose[15], pose[17]


@kernel
def swings(surface: Any, x: float, y: float, time: float, real: Any, imag: Any) -> None:
    """a exp(i theta) of the sea's waves at a place and time."""
    count = int(surface[KNOWN])
    at = int(surface[AT_KNOWN])
    px, py = x - surface[CURRENT_X] * time, y - surface[CURRENT_Y] * time
    for i in range(count):
        angle = (
            surface[at + i] * (surface[at + 2 * count + i] * px + surface[at + 3 * count + i] * py)
            - surface[at + count + i] * time
            + surface[at + 5 * count + i]
        )
        amplitude = surface[at + 4 * count + i]
        real[i], imag[i] = amplitude * math.cos(angle), amplitude * math.sin(angle)


@kernel
def water_at(
    surface: Any, x: float, y: float, z: float, time: float, scratch: Any, out: Any
) -> None:
    """Elevation and velocity (3) of the sea at a point, current included, into out (4)."""
    count = int(surface[KNOWN])
    at = int(surface[AT_KNOWN])
    real, imag = scratch[:count], scratch[count : 2 * count]
    swings(surface, x, y, time, real, imag)
    out[0], out[1], out[2], out[3] = 0.0, surface[CURRENT_X], surface[CURRENT_Y], 0.0
    depth, z = surface[DEPTH], min(z, 0.0)
    for i in range(count):
        k = surface[at + i]
        rise = math.exp(k * z)
        sink = rise
        if depth > 0.0:
            bottom = 1.0 + math.exp(-2.0 * k * depth)
            below = math.exp(-2.0 * k * (max(z, -depth) + depth))
            rise, sink = rise * (1.0 + below) / bottom, rise * (1.0 - below) / bottom
        rate = surface[GRAVITY] * k / surface[at + count + i]
        out[0] += real[i]
        out[1] += real[i] * rate * rise * surface[at + 2 * count + i]
        out[2] += real[i] * rate * rise * surface[at + 3 * count + i]
        out[3] += imag[i] * rate * sink


@kernel
def known_readings(surface: Any, body: Any, real: Any, imag: Any, yaw: float, out: Any) -> None:
    """Diffraction force (6) and flow (patterns) of the sea's waves on a hull, level frame."""
    count, width = int(surface[KNOWN]), 6 + int(body[PATTERNS])
    out[:width] = 0.0
    if count == 0:
        return
    headings = int(body[HEADINGS])
    place = yaw / TURN
    place = (place - math.floor(place)) * headings
    a = int(place) % headings
    b, share = (a + 1) % headings, place - math.floor(place)
    size = 2 * count * width
    first, second = int(body[AT_SEEN]) + a * size, int(body[AT_SEEN]) + b * size
    for i in range(count):
        p, q = (1.0 - share) * real[i], share * real[i]
        r, s = (1.0 - share) * imag[i], share * imag[i]
        f, g = first + 2 * i * width, second + 2 * i * width
        for n in range(width):
            out[n] += (
                p * body[f + n]
                - r * body[f + width + n]
                + q * body[g + n]
                - s * body[g + width + n]
            )


@vector_kernel
def _wave_phases(rate: Any, place: float, cosine: Any, sine: Any) -> None:
    """cos and sin of rate * place, for many rates at once; see `phases`."""
    for n in range(rate.shape[0]):
        angle = rate[n] * place
        turns = np.floor(angle * (1.0 / TURN) + 0.5)
        h = 0.125 * (angle - turns * TURN)
        s = h * h
        si = h * (1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s / 362880.0))))
        vs = s * (
            0.5 + s * (-1.0 / 24.0 + s * (1.0 / 720.0 + s * (-1.0 / 40320.0 + s / 3628800.0)))
        )
        for _ in range(3):
            si, vs = 2.0 * si * (1.0 - vs), 2.0 * si * si
        cosine[n], sine[n] = 1.0 - vs, si


@vector_kernel
def _sum_heads(
    real: Any, imag: Any, cosine: Any, sine: Any, decays: Any, count: int, head: Any, out: Any
) -> None:  # fmt: skip
    """Re (real + i imag)(cosine + i sine) of every wave, summed with the decays of each level, into out (LEVELS)."""
    for n in range(count):
        head[n] = real[n] * cosine[n] - imag[n] * sine[n]
    for level in range(LEVELS):
        total = 0.0
        for n in range(count):
            total += head[n] * decays[level * count + n]
        out[level] = total


@kernel
def _chebyshev(u: float, count: int, out: Any) -> None:
    """T_0 .. T_(count - 1) at u."""
    out[0] = 1.0
    before, now = 1.0, u
    for k in range(1, count):
        out[k] = now
        before, now = now, 2.0 * u * now - before


@kernel
def _transform(grid: Any, outer: int, count: int, inner: int, line: Any) -> None:
    """Values at Chebyshev's nodes to coefficients, along the middle axis of grid (outer, count, inner)."""
    for o in range(outer):
        for n in range(inner):
            for k in range(count):
                total = 0.0
                for a in range(count):
                    total += grid[(o * count + a) * inner + n] * COSINES[count, k, a]
                line[k] = total * (1.0 if k == 0 else 2.0) / count
            for k in range(count):
                grid[(o * count + k) * inner + n] = line[k]


@kernel
def wetted_pressure(
    surface: Any, body: Any, pose: Any, yaw: float, real: Any, imag: Any, heights: Any, scratch: Any, out: Any
) -> float:  # fmt: skip
    """Force and torque about the centre of mass of water at rest and of the sea on the wetted hull, world, into out (6).

    Args:
        surface: block.
        body: block.
        pose: state (18).
        yaw: heading [rad].
        real: swings of the sea's waves at the centre of mass, and `imag`.
        heights: room for one number a vertex.
        scratch: room, see `scratch_size`.
        out: added to.

    Returns:
        The depth of the lowest vertex below the surface [m].
    """
    vertices, faces = int(body[VERTICES]), int(body[FACES])
    at, count = int(body[AT_VERTICES]), int(surface[KNOWN])
    places = scratch[: 3 * vertices]
    c, s = math.cos(yaw), math.sin(yaw)
    # vertices about the centre of mass, turned back by the heading; heights above z = 0
    west = south = np.inf
    east = north = -np.inf
    low = np.inf
    for v in range(vertices):
        x, y, z = body[at + 3 * v], body[at + 3 * v + 1], body[at + 3 * v + 2]
        px = pose[3] * x + pose[4] * y + pose[5] * z
        py = pose[6] * x + pose[7] * y + pose[8] * z
        pz = pose[9] * x + pose[10] * y + pose[11] * z
        ax, ay = c * px + s * py, c * py - s * px
        places[3 * v], places[3 * v + 1], places[3 * v + 2] = ax, ay, pz
        west, east, south, north = min(west, ax), max(east, ax), min(south, ay), max(north, ay)
        heights[v] = pz + pose[2]
        low = min(low, heights[v])
    if count > 0:
        _add_sea(
            surface, vertices, yaw, low, west, east, south, north, real, imag, heights, places,
            scratch[3 * vertices :], int(body[NODES_X]), int(body[NODES_Y]),
        )  # fmt: skip
    first = int(body[AT_FACES])
    weight = body[DENSITY] * surface[GRAVITY]
    fx = fy = fz = tx = ty = tz = 0.0
    for f in range(faces):
        i, j, k = (
            int(body[first + 3 * f]),
            int(body[first + 3 * f + 1]),
            int(body[first + 3 * f + 2]),
        )
        ha, hb, hc = heights[i], heights[j], heights[k]
        if ha >= 0.0 and hb >= 0.0 and hc >= 0.0:
            continue
        ax, ay, az = places[3 * i], places[3 * i + 1], places[3 * i + 2]
        bx, by, bz = places[3 * j], places[3 * j + 1], places[3 * j + 2]
        cx, cy, cz = places[3 * k], places[3 * k + 1], places[3 * k + 2]
        # twice the area vector
        nx = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
        ny = (bz - az) * (cx - ax) - (bx - ax) * (cz - az)
        nz = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        depth, mx, my, mz = column(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
        fx += depth * nx
        fy += depth * ny
        fz += depth * nz
        tx += my * nz - mz * ny
        ty += mz * nx - mx * nz
        tz += mx * ny - my * nx
    half = 0.5 * weight
    out[0] += half * (c * fx - s * fy)
    out[1] += half * (s * fx + c * fy)
    out[2] += half * fz
    out[3] += half * (c * tx - s * ty)
    out[4] += half * (s * tx + c * ty)
    out[5] += half * tz
    deepest = 0.0
    for v in range(vertices):
        deepest = min(deepest, heights[v])
    return -deepest


@kernel
def _add_sea(
    surface: Any, vertices: int, yaw: float, low: float, west: float, east: float, south: float, north: float,
    real: Any, imag: Any, heights: Any, places: Any, scratch: Any, nx: int, ny: int,
) -> None:  # fmt: skip
    """Lower heights (vertices,) by the sea's pressure head, interpolated from a grid around the body.

    The grid has Chebyshev's nodes along, across and in depth, from the lowest vertex to z = 0. Vertices higher
    than the crests can be are left as they are.
    """
    dry = 0.0
    for i in range(int(surface[KNOWN])):
        dry += math.sqrt(real[i] * real[i] + imag[i] * imag[i])
    count, at, depth = int(surface[KNOWN]), int(surface[AT_KNOWN]), surface[DEPTH]
    half_x, half_y = max(0.5 * (east - west), 1e-9), max(0.5 * (north - south), 1e-9)
    middle_x, middle_y = 0.5 * (east + west), 0.5 * (north + south)
    low = min(low, -1e-9)
    decays = scratch[: LEVELS * count]
    grid = scratch[LEVELS * count : LEVELS * (count + MAX_NODES * MAX_NODES)]
    rest = scratch[LEVELS * (count + MAX_NODES * MAX_NODES) :]
    kx, ky, head = rest[:count], rest[count : 2 * count], rest[2 * count : 3 * count]
    cosine, sine = rest[3 * count : 4 * count], rest[4 * count : 5 * count]
    u, v = rest[5 * count : 6 * count], rest[6 * count : 7 * count]
    ys = rest[7 * count : (7 + 2 * MAX_NODES) * count]
    line = rest[(7 + 2 * MAX_NODES) * count :]
    # the waves along and across the body, their decay with depth
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(count):
        k = surface[at + i]
        toward, aside = surface[at + 2 * count + i], surface[at + 3 * count + i]
        kx[i], ky[i] = k * (c * toward + s * aside), k * (c * aside - s * toward)
        for level in range(LEVELS):
            z = 0.5 * low * (1.0 + COSINES[LEVELS, 1, level])
            decay = math.exp(k * z)
            if depth > 0.0:
                decay *= (1.0 + math.exp(-2.0 * k * (max(z, -depth) + depth))) / (
                    1.0 + math.exp(-2.0 * k * depth)
                )
            decays[level * count + i] = decay
    # pressure head at the nodes
    for b in range(ny):
        place = middle_y + half_y * COSINES[ny, 1, b]
        _wave_phases(ky, place, ys[2 * b * count :], ys[(2 * b + 1) * count :])
    for a in range(nx):
        _wave_phases(kx, middle_x + half_x * COSINES[nx, 1, a], cosine, sine)
        for i in range(count):
            u[i] = real[i] * cosine[i] - imag[i] * sine[i]
            v[i] = real[i] * sine[i] + imag[i] * cosine[i]
        for b in range(ny):
            _sum_heads(
                u, v, ys[2 * b * count :], ys[(2 * b + 1) * count :], decays, count, head,
                grid[(a * ny + b) * LEVELS :],
            )  # fmt: skip
    _transform(grid, 1, nx, ny * LEVELS, line)
    _transform(grid, nx, ny, LEVELS, line)
    _transform(grid, nx * ny, LEVELS, 1, line)
    wx, wy, wz = line[:MAX_NODES], line[MAX_NODES : 2 * MAX_NODES], line[2 * MAX_NODES :]
    for n in range(vertices):
        if heights[n] > dry:
            continue
        _chebyshev((places[3 * n] - middle_x) / half_x, nx, wx)
        _chebyshev((places[3 * n + 1] - middle_y) / half_y, ny, wy)
        _chebyshev(2.0 * max(min(heights[n], 0.0), low) / low - 1.0, LEVELS, wz)
        total = 0.0
        for a in range(nx):
            row = 0.0
            for b in range(ny):
                m = (a * ny + b) * LEVELS
                row += wy[b] * (
                    wz[0] * grid[m]
                    + wz[1] * grid[m + 1]
                    + wz[2] * grid[m + 2]
                    + wz[3] * grid[m + 3]
                )
            total += wx[a] * row
        heights[n] -= total


@kernel
def _turned_wrench(yaw: float, load: Any, out: Any) -> None:
    """Add a force and torque (6) of the level frame to out (6), world."""
    c, s = math.cos(yaw), math.sin(yaw)
    out[0] += c * load[0] - s * load[1]
    out[1] += s * load[0] + c * load[1]
    out[2] += load[2]
    out[3] += c * load[3] - s * load[4]
    out[4] += s * load[3] + c * load[4]
    out[5] += load[5]


@kernel
def _turning_terms(body: Any, motion: Any, rate: float, out: Any) -> None:
    """Of the added mass in a frame that turns at `rate`: A (w x V) - w x (A V), and -v x (A V) on the torque, (6)."""
    for i in range(6):
        out[i] = 0.0
    ax, ay, mx, my = -rate * motion[1], rate * motion[0], -rate * motion[4], rate * motion[3]
    px = py = hx = hy = 0.0
    for j in range(6):
        px += body[ADDED + j] * motion[j]
        py += body[ADDED + 6 + j] * motion[j]
        hx += body[ADDED + 18 + j] * motion[j]
        hy += body[ADDED + 24 + j] * motion[j]
    for i in range(6):
        k = ADDED + 6 * i
        out[i] = body[k] * ax + body[k + 1] * ay + body[k + 3] * mx + body[k + 4] * my
    out[0] += rate * py
    out[1] -= rate * px
    out[3] += rate * hy
    out[4] -= rate * hx
    out[5] -= motion[0] * py - motion[1] * px


@kernel
def add_impact(surface: Any, body: Any, pose: Any, rate: float, out: Any) -> None:
    """Add -dA/dt V to a force (6), world: water that a body takes with it as it comes in had not its speed before.

    The momentum of von Karman's wedge (NACA TN 321, 1929); rate is dA/dt over A [1/s]. On the way out there is none.
    """
    yaw = heading(body, pose)
    c, s = math.cos(yaw), math.sin(yaw)
    u, v = pose[12] - surface[CURRENT_X], pose[13] - surface[CURRENT_Y]
    x, y, z = c * u + s * v, c * v - s * u, pose[14]
    a, b, w = c * pose[15] + s * pose[16], c * pose[16] - s * pose[15], pose[17]
    k = ADDED
    fx = fy = fz = tx = ty = tz = 0.0
    for j in range(6):
        speed = (
            x if j == 0 else y if j == 1 else z if j == 2 else a if j == 3 else b if j == 4 else w
        )
        amount = -rate * speed
        fx += amount * body[k + j]
        fy += amount * body[k + 6 + j]
        fz += amount * body[k + 12 + j]
        tx += amount * body[k + 18 + j]
        ty += amount * body[k + 24 + j]
        tz += amount * body[k + 30 + j]
    out[0] += c * fx - s * fy
    out[1] += s * fx + c * fy
    out[2] += fz
    out[3] += c * tx - s * ty
    out[4] += s * tx + c * ty
    out[5] += tz


@kernel
def scratch_size(surface: Any, body: Any) -> int:
    """Doubles that `body_force` and `push_waves` need for a body."""
    waves, count = int(surface[WAVES]), int(surface[KNOWN])
    return (
        6 * waves + int(body[HARMONICS]) + 2 * int(body[ROWS]) + 32
        + 4 * int(body[VERTICES])
        + (LEVELS + 9 + 2 * MAX_NODES) * count + LEVELS * MAX_NODES * MAX_NODES + 4 * MAX_NODES
    )  # fmt: skip


@kernel
def _offset(surface: Any, state: Any, pose: Any) -> tuple[float, float]:
    """Place of a body from the modes' origin, kept within their reach."""
    x, y = pose[0] - state[ORIGIN_X], pose[1] - state[ORIGIN_Y]
    away, most = math.sqrt(x * x + y * y), surface[REACH]
    if away > most:
        x, y = x * most / away, y * most / away
    return x, y


# Over 80 lines: the terms of one equation share a dozen locals, and its docstring states it.
@kernel
def body_force(
    surface: Any, body: Any, state: Any, slot: int, pose: Any, time: float, keep: bool, parts: Any,
    first: Any, scratch: Any, out: Any,
) -> float:  # fmt: skip
    """Force and torque of the water on a body, without drag and added mass, added to out (6), world.

    Args:
        surface: block.
        body: block.
        state: of the instance.
        slot: where the body's readings are in it.
        pose: state (18) of the body.
        time: [s].
        keep: whether to keep the readings for the surface's next step.
        parts: orders, starts and turn starts of the body's rings (3, rings).
        first: of the rings, with the end.
        scratch: room.
        out: added to.

    Returns:
        How much of the hull takes part in radiation: 1, less when it is nearly out of the water, 0 when it is.
    """
    waves, count = int(surface[WAVES]), int(surface[KNOWN])
    yaw = heading(body, pose)
    x, y = _offset(surface, state, pose)
    cosine, sine = scratch[:waves], scratch[waves : 2 * waves]
    real, imag = scratch[2 * waves : 3 * waves], scratch[3 * waves : 4 * waves]
    at = 4 * waves
    harmonics = scratch[at : at + int(body[HARMONICS])]
    at += int(body[HARMONICS])
    readings = scratch[at : at + int(body[ROWS])]
    at += int(body[ROWS])
    known = scratch[at : at + 6 + int(body[PATTERNS])]
    at += int(body[ROWS])
    small = scratch[at : at + 16]
    at += 16
    swing = scratch[at : at + 2 * count]
    at += 2 * count
    heights = scratch[at : at + int(body[VERTICES])]
    at += int(body[VERTICES])
    # still water and the sea on the true hull
    swings(surface, pose[0], pose[1], time, swing[:count], swing[count:])
    depth = wetted_pressure(
        surface, body, pose, yaw, swing[:count], swing[count:], heights, scratch[at:], out
    )
    weight = min(max(depth / (WET_SHARE * body[DRAFT]), 0.0), 1.0)
    if weight == 0.0:
        if keep:
            for n in range(int(body[PATTERNS]) + int(body[LIDS])):
                state[slot + n] = 0.0
        return 0.0
    # the waves at the body's origin
    re, im = state[STATE : STATE + waves], state[STATE + waves : STATE + 2 * waves]
    if x == 0.0 and y == 0.0:
        real[:], imag[:] = re, im
    else:
        _phases_at(surface, x, y, cosine, sine)
        for n in range(waves):
            real[n] = re[n] * cosine[n] - im[n] * sine[n]
            imag[n] = re[n] * sine[n] + im[n] * cosine[n]
    turns = body[int(body[AT_TURNS]) : int(body[AT_ROWS])]
    gather(real, imag, first, parts[0], parts[1], parts[2], turns, yaw, harmonics)
    size = int(body[ROWS]) * int(body[HARMONICS])
    rows = body[int(body[AT_ROWS]) : int(body[AT_ROWS]) + size].reshape(
        (int(body[ROWS]), int(body[HARMONICS]))
    )
    read_rows(rows, harmonics, readings)
    lids, patterns = int(body[LIDS]), int(body[PATTERNS])
    for i in range(6):
        for n in range(lids):
            readings[i] += body[int(body[AT_LID]) + i * lids + n] * readings[6 + patterns + n]
    known_readings(surface, body, swing[:count], swing[count:], yaw, known)
    if keep:
        for n in range(patterns):
            state[slot + n] = weight * (readings[6 + n] + known[6 + n])
        for n in range(patterns, patterns + lids):
            state[slot + n] = weight * readings[6 + n]
    motion, turning = small[:6], small[6:12]
    to_heading(yaw, pose, surface[CURRENT_X], surface[CURRENT_Y], motion)
    _turning_terms(body, motion, pose[17], turning)
    for i in range(6):
        turning[i] = weight * (weight * turning[i] + readings[i] + known[i])
    _turned_wrench(yaw, turning, out)
    return float(weight)


@kernel
def push_waves(
    surface: Any, body: Any, state: Any, slot: int, pose: Any, weight: float, parts: Any, first: Any,
    scratch: Any, added: Any,
) -> None:  # fmt: skip
    """What a body gives to the surface in a step that ends now, added to `added` (2 waves,); weight of `body_force`."""
    waves = int(surface[WAVES])
    yaw = heading(body, pose)
    x, y = _offset(surface, state, pose)
    cosine, sine = scratch[:waves], scratch[waves : 2 * waves]
    real, imag = scratch[2 * waves : 3 * waves], scratch[3 * waves : 4 * waves]
    at = 4 * waves
    harmonics = scratch[at : at + int(body[HARMONICS])]
    at += int(body[HARMONICS])
    amounts = scratch[at : at + int(body[ROWS])]
    at += int(body[ROWS])
    lids, patterns = int(body[LIDS]), int(body[PATTERNS])
    to_heading(yaw, pose, surface[CURRENT_X], surface[CURRENT_Y], amounts[:6])
    for n in range(patterns + lids):
        amounts[6 + n] = state[slot + n]
    for n in range(int(body[ROWS])):
        amounts[n] *= weight
    size = int(body[ROWS]) * int(body[HARMONICS])
    columns = body[int(body[AT_COLUMNS]) : int(body[AT_COLUMNS]) + size].reshape(
        (int(body[ROWS]), int(body[HARMONICS]))
    )
    add_columns(columns, amounts, harmonics)
    turns = body[int(body[AT_TURNS]) : int(body[AT_ROWS])]
    scatter(harmonics, first, parts[0], parts[1], parts[2], turns, yaw, real, imag)
    if x != 0.0 or y != 0.0:
        _phases_at(surface, -x, -y, cosine, sine)
        for n in range(waves):
            added[n] += real[n] * cosine[n] - imag[n] * sine[n]
            added[waves + n] += real[n] * sine[n] + imag[n] * cosine[n]
    else:
        for n in range(waves):
            added[n] += real[n]
            added[waves + n] += imag[n]


@kernel
def step_waves(
    surface: Any, state: Any, x: float, y: float, step: float, scratch: Any, added: Any
) -> None:  # fmt: skip
    """One step of the surface with what was added; the origin drifts with the current, then goes to (x, y)."""
    waves = int(surface[WAVES])
    w = int(surface[AT_WAVES])
    real, imag = state[STATE : STATE + waves], state[STATE + waves : STATE + 2 * waves]
    turn_real, turn_imag = scratch[:waves], scratch[waves : 2 * waves]
    if step == surface[TIMESTEP]:
        turn_real[:] = surface[w + 4 * waves : w + 5 * waves]
        turn_imag[:] = surface[w + 5 * waves : w + 6 * waves]
    else:
        for n in range(waves):
            a, b = surface[w + 6 * waves + n] * step, surface[w + 7 * waves + n] * step
            decay = math.exp(b)
            turn_real[n], turn_imag[n] = decay * math.cos(a), -decay * math.sin(a)
    advance_waves(real, imag, added[:waves], added[waves:], turn_real, turn_imag, step)
    state[ORIGIN_X] += surface[CURRENT_X] * step
    state[ORIGIN_Y] += surface[CURRENT_Y] * step
    move_x, move_y = x - state[ORIGIN_X], y - state[ORIGIN_Y]
    if move_x != 0.0 or move_y != 0.0:
        cosine, sine = scratch[:waves], scratch[waves : 2 * waves]
        _phases_at(surface, move_x, move_y, cosine, sine)
        for n in range(waves):
            a, b = real[n], imag[n]
            real[n] = a * cosine[n] - b * sine[n]
            imag[n] = a * sine[n] + b * cosine[n]
        state[ORIGIN_X], state[ORIGIN_Y] = x, y
