"""The water's step on square tiles that know their neighbours, and what passes between them and a stone.

Tiles lie in pools `z` and `prev`, (capacity, TILE, TILE). `neighbours[k]` are the slots of the nine
tiles around slot k, row by row from (-x, -y) to (+x, +y): itself in the middle, SLEEPING (a slot
that is always level) or WALL where there is none.

Blocks of cells, patches that stones feel and heads that they press, reach the tiles through `slots`, (a, b)
slots of the tiles under them, and the place (i, j) of the block's first cell in the first of those tiles.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import address_of, call_address
from mjskip.waves._row import column_sum, step_rows

Pool = npt.NDArray[np.float32]
Slots = npt.NDArray[np.int32]

TILE = 64
"""Cells along a side, a whole number of vectors: its rows stay in the first-level cache."""

SLEEPING = 0
WALL = -1

NO_LAND = np.zeros((0, 0), np.float32)


@kernel
def step_tiles(
    z: Pool,
    prev: Pool,
    neighbours: Slots,
    first: int,
    last: int,
    q: float,
    s: float,
    sides: npt.NDArray[np.float32],
) -> None:
    """prev = z + q (z - prev) + s L(z) in tiles first..last; see `_wave_kernels.step_nine`.

    Every cell is the same sum in the same order as there, so the two agree to the last bit.

    Args:
        sides: (2, TILE + 2), for the cells beside a tile.
    """
    along, sixth = np.float32(q), np.float32(s) / np.float32(6.0)
    n = TILE
    cells, out = z.reshape(z.size), prev.reshape(prev.size)
    west, east = sides[0], sides[1]
    for k in range(first, last):
        # What lies beyond each side: the neighbour's rim, or at a wall the tile's own.
        south, north = neighbours[k, 1], neighbours[k, 7]
        own = k * n * n
        before = own if south == WALL else (south * n + n - 1) * n
        after = own + (n - 1) * n if north == WALL else north * n * n
        left, right = neighbours[k, 3], neighbours[k, 5]
        for r in range(n):
            west[r + 1] = z[left, r, n - 1] if left != WALL else z[k, r, 0]
            east[r + 1] = z[right, r, 0] if right != WALL else z[k, r, n - 1]
        west[0], east[0], west[n + 1], east[n + 1] = west[1], east[1], west[n], east[n]
        if south != WALL:
            left, right = neighbours[k, 0], neighbours[k, 2]
            west[0] = z[left, n - 1, n - 1] if left != WALL else z[south, n - 1, 0]
            east[0] = z[right, n - 1, 0] if right != WALL else z[south, n - 1, n - 1]
        if north != WALL:
            left, right = neighbours[k, 6], neighbours[k, 8]
            west[n + 1] = z[left, 0, n - 1] if left != WALL else z[north, 0, 0]
            east[n + 1] = z[right, 0, 0] if right != WALL else z[north, 0, n - 1]
        for r in range(0, n, 4):
            at = own + r * n
            starts = (
                before if r == 0 else at - n,
                at,
                at + n,
                at + 2 * n,
                at + 3 * n,
                after if r == n - 4 else at + 4 * n,
            )
            sums_west = (
                column_sum(west[r], west[r + 1], west[r + 2]),
                column_sum(west[r + 1], west[r + 2], west[r + 3]),
                column_sum(west[r + 2], west[r + 3], west[r + 4]),
                column_sum(west[r + 3], west[r + 4], west[r + 5]),
            )
            sums_east = (
                column_sum(east[r], east[r + 1], east[r + 2]),
                column_sum(east[r + 1], east[r + 2], east[r + 3]),
                column_sum(east[r + 2], east[r + 3], east[r + 4]),
                column_sum(east[r + 3], east[r + 4], east[r + 5]),
            )
            step_rows(cells, starts, out, n, sums_west, sums_east, along, sixth)


@kernel
def find_calls(
    z: Pool, neighbours: Slots, used: int, amplitude: float, calls: npt.NDArray[np.int32]
) -> int:
    """List (slot, direction) of sleeping neighbours that a tile's rim now reaches; their number."""
    n = z.shape[1]
    found = 0
    for k in range(1, used):
        for direction in range(9):
            if neighbours[k, direction] != SLEEPING:
                continue
            x, y = direction // 3, direction % 3
            i0, i1 = (0, n) if x == 1 else ((0, 1) if x == 0 else (n - 1, n))
            j0, j1 = (0, n) if y == 1 else ((0, 1) if y == 0 else (n - 1, n))
            loud = False
            for i in range(i0, i1):
                for j in range(j0, j1):
                    loud = loud or abs(z[k, i, j]) > amplitude
            if loud:
                calls[found, 0], calls[found, 1] = k, direction
                found += 1
    return found


@kernel
def step_and_listen(
    z: Pool,
    prev: Pool,
    neighbours: Slots,
    used: int,
    q: float,
    s: float,
    sides: npt.NDArray[np.float32],
    amplitude: float,
    calls: npt.NDArray[np.int32],
) -> int:
    """Step all tiles that are awake, and `find_calls` at the level after it, which is in prev."""
    step_tiles(z, prev, neighbours, 1, used, q, s, sides)
    return find_calls(prev, neighbours, used, amplitude, calls)


@kernel
def find_quiet(
    z: Pool, prev: Pool, used: int, amplitude: float, quiet: npt.NDArray[np.int32]
) -> int:
    """List the slots of tiles whose last two levels both stay within the amplitude; their number."""
    found = 0
    for k in range(1, used):
        high = np.float32(0.0)
        for i in range(z.shape[1]):
            for j in range(z.shape[2]):
                high = max(high, max(abs(z[k, i, j]), abs(prev[k, i, j])))
            if high > amplitude:
                break
        if high <= amplitude:
            quiet[found] = k
            found += 1
    return found


@kernel
def fill_head(head: Any, centre_x: float, centre_y: float, reach: float, volume: float) -> None:
    """Pressure head of a round load: (1 - (r / reach)^2)^2 inside `reach`, its sum = `volume`.

    Lengths are in cells and (centre_x, centre_y) is the centre in indices of `head`. The sum is
    taken over the cells themselves, so the load is exact wherever the centre falls between them.
    """
    total = 0.0
    scale = 1.0 / (reach * reach)
    for i in range(head.shape[0]):
        for j in range(head.shape[1]):
            inside = 1.0 - ((i - centre_x) ** 2 + (j - centre_y) ** 2) * scale
            if inside > 0.0:
                head[i, j] = inside * inside
                total += inside * inside
            else:
                head[i, j] = 0.0
    head *= np.float32(volume / total)


@kernel
def add_to_patch(z: Any, prev: Any, slots: Any, i: int, j: int, rate: float, points: Any) -> float:
    """points += elevation and vertical speed, (2, n, n); the greatest |elevation| there is then.

    rate = 1 / time step.
    """
    n, tile = points.shape[1], z.shape[1]
    for a in range(slots.shape[0]):
        for b in range(slots.shape[1]):
            slot = slots[a, b]
            if slot <= 0:
                continue
            first, east = i - a * tile, j - b * tile  # the block's first cell, seen from this tile
            for p in range(max(0, -first), min(n, tile - first)):
                for q in range(max(0, -east), min(n, tile - east)):
                    level = np.float64(z[slot, first + p, east + q])
                    points[0, p, q] += level
                    points[1, p, q] += (level - prev[slot, first + p, east + q]) * rate
    highest = 0.0
    for p in range(n):
        for q in range(n):
            highest = max(highest, abs(points[0, p, q]))
    return highest


@kernel
def work_under(z: Any, prev: Any, slots: Any, i: int, j: int, head: Any) -> float:
    """Sum of head times (z - prev) over the cells of a head."""
    tile = z.shape[1]
    work = 0.0
    for p in range(head.shape[0]):
        for q in range(head.shape[1]):
            a, b = (i + p) // tile, (j + q) // tile
            slot = slots[a, b]
            if slot > 0:
                r, s = i + p - a * tile, j + q - b * tile
                work += head[p, q] * (np.float64(z[slot, r, s]) - prev[slot, r, s])
    return work


@kernel
def largest_share(linear: float, square: float, loss: float) -> float:
    """Largest s in [0, 1] with s linear + s^2 square <= loss; square and loss are at least 0."""
    if linear + square <= loss:
        return 1.0
    root = math.sqrt(linear * linear + 4.0 * square * loss)
    if linear > 0.0:
        return min(1.0, 2.0 * loss / (linear + root))
    return min(1.0, 0.5 * (root - linear) / square)


@kernel
def press(
    z: Any, prev: Any, slots: Any, first_i: int, first_j: int, i: int, j: int, nx: int, ny: int,
    head: Any, wet: Any, bent: Any, edge: float, corner: float, weight: float, elsewhere: float, loss: float,
) -> tuple[float, float]:  # fmt: skip
    """z += s L(head), s the largest share that gives the waves no more than the loss; s and the gain.

    With heads h the waves gain W = -w sum h (z+ - z) over the step, w the weight of a head of a metre on
    a cell. The free step gave z+ - z = D, a share s of the head adds s L(h), L with weights edge and
    corner, so

        W(s) = -w (s sum h D + s^2 sum h L(h)),    sum h L(h) <= 0

    Args:
        slots: of the tiles under the head and one cell all round it.
        first_i, first_j: first cell of the first tile.
        i, j: first cell of the head.
        nx, ny: cells inside walls, which mirror the head; 0 without walls.
        wet: 1 in water, 0 on land, for the cells from (i - 2, j - 2) on; empty if there is no land.
        bent: for L(h), at least two cells more each way than the head.
        elsewhere: sum h D in other waters whose waves add up with these.
    """
    tile = z.shape[1]
    high, wide = head.shape
    square = 0.0
    for p in range(-1, high + 1):
        for q in range(-1, wide + 1):
            bent[p + 1, q + 1] = 0.0
            if nx and not (0 <= i + p < nx and 0 <= j + q < ny):
                continue
            if wet.size and wet[p + 2, q + 2] == 0.0:
                continue
            inside = 0 <= p < high and 0 <= q < wide
            here = np.float64(head[p, q]) if inside else 0.0
            total = 0.0
            for dp in range(-1, 2):
                for dq in range(-1, 2):
                    c, d = p + dp, q + dq
                    if nx:
                        c = min(max(i + c, 0), nx - 1) - i
                        d = min(max(j + d, 0), ny - 1) - j
                    if wet.size and wet[c + 2, d + 2] == 0.0:
                        continue
                    there = 0.0
                    if 0 <= c < high and 0 <= d < wide:
                        there = np.float64(head[c, d])
                    if dp != 0 or dq != 0:
                        total += (edge if dp == 0 or dq == 0 else corner) * (there - here)
            bent[p + 1, q + 1] = total
            square += here * total
    square *= -weight
    work = work_under(z, prev, slots, i - first_i, j - first_j, head)
    linear = -weight * (work + elsewhere)
    share = largest_share(linear, square, loss)
    for p in range(-1, high + 1):
        for q in range(-1, wide + 1):
            a, b = (i + p - first_i) // tile, (j + q - first_j) // tile
            slot = slots[a, b]
            if slot > 0:
                r, s = i + p - first_i - a * tile, j + q - first_j - b * tile
                z[slot, r, s] += np.float32(share * bent[p + 1, q + 1])
    return share, share * linear + share * share * square


@kernel
def all_asleep(slots: Any, first_a: int, first_b: int, i: int, j: int, side: int) -> bool:
    """Whether all tiles under a square of cells are asleep or outside, as far as `slots` knows."""
    for a in range(i // TILE - first_a, (i + side - 1) // TILE - first_a + 1):
        for b in range(j // TILE - first_b, (j + side - 1) // TILE - first_b + 1):
            if not (0 <= a < slots.shape[0] and 0 <= b < slots.shape[1]) or slots[a, b] > 0:
                return False
    return True


@kernel
def none_asleep(
    slots: Any, first_a: int, first_b: int, i: int, j: int, high: int, wide: int
) -> bool:
    """Whether all tiles under a block of cells are awake or outside, as far as `slots` knows."""
    for a in range(i // TILE - first_a, (i + high - 1) // TILE - first_a + 1):
        for b in range(j // TILE - first_b, (j + wide - 1) // TILE - first_b + 1):
            if not (0 <= a < slots.shape[0] and 0 <= b < slots.shape[1]) or slots[a, b] == SLEEPING:
                return False
    return True


# numbers that `glide` is given
(
    ORIGIN_X, ORIGIN_Y, SPACING, NARROWEST, PATCH_SIDE, TIMESTEP, WEIGHT, STRENGTH, DAMP, SCALE, EDGE, CORNER,
    AMPLITUDE, REACH,
) = range(14)  # fmt: skip
NUMBERS = 14
LOADS, LIMITED, LOST, GAINED, TAKEN, GIVEN = range(6)
"""Of a balance: see `twoway.Balance`."""


@kernel
def observe_at(wrench: int, immersion: int, block: Any, state: Any, out: Any) -> bool:
    """`mjskip.hydro.wrench.observe` of one state (18,) into out (17,), by address; whether all is finite."""
    call_address(wrench, address_of(block), address_of(state), address_of(out))
    call_address(immersion, address_of(block), address_of(state), address_of(out) + 8 * 12)
    total = 0.0
    for n in range(17):
        total += out[n]
    return bool(np.isfinite(total))


@kernel
def undisturbed(slots: Any, first_a: int, first_b: int, state: Any, numbers: Any) -> bool:
    """Whether all water under a stone's patch sleeps, as far as `slots` knows."""
    half = int(numbers[PATCH_SIDE]) // 2
    x = (state[0] - numbers[ORIGIN_X]) / numbers[SPACING]
    y = (state[1] - numbers[ORIGIN_Y]) / numbers[SPACING]
    i, j = int(np.rint(x)) - half, int(np.rint(y)) - half
    return all_asleep(slots, first_a, first_b, i, j, 2 * half + 1)


@kernel
def fly(
    hop: int, context: Any, wrench: int, immersion: int, block: Any, states: Any, seen: Any,
    common: Any, first_a: int, first_b: int, numbers: Any,
) -> int:  # fmt: skip
    """Steps of one stone in the air, high above the waves or over water that sleeps; their number.

    It ends before a step in which the stone is wet or waves are near. Arguments as for `glide`.
    """
    done = 0
    while done < seen.shape[0]:
        state, out = states[done], seen[done]
        finite = observe_at(wrench, immersion, block, state, out)
        if not finite or out[16] < 0.0 or out[2] != 0.0:
            break
        near = out[16] < numbers[REACH]
        if near and not undisturbed(common, first_a, first_b, state, numbers):
            break
        done += 1
        call_address(hop, address_of(context), address_of(states[done]), 0)
    return done


@kernel
def glide(
    hop: int, context: Any, wrench: int, immersion: int, block: Any,
    states: Any, seen: Any, shares: Any,
    z: Pool, prev: Pool, neighbours: Slots, used: int, sides: Any, calls: Any,
    slots: Any, first_a: int, first_b: int, nx: int, ny: int,
    common: Any, common_a: int, common_b: int,
    numbers: Any, head: Any, bent: Any, balance: Any,
) -> tuple[int, int]:  # fmt: skip
    """Steps of one stone in water that it alone moves: what `twoway.MovingSurface` does, without leaving
    compiled code.

    Every step: the forces at the state are observed, the stone's own water makes its free step, gets the
    reaction, and the engine steps on. It ends before a step in which the stone is dry, another water moves
    under it, or its load reaches a tile that sleeps; and after one whose waves call a sleeping neighbour.

    Args:
        hop: address of what steps the engine, void(context, state after it, unused).
        wrench, immersion: addresses of the force kernel's two halves.
        states: (n + 1, 18), the first row given.
        seen: (n, 17) observed; shares: (n,) given to the water.
        z, prev, neighbours, used, sides, calls: of the stone's own water; z and prev change roles each step.
        slots: of tiles of that water from tile (first_a, first_b) on.
        nx, ny: its cells inside walls; 0 without.
        common: slots of tiles of the common water from tile (common_a, common_b) on.
        numbers: see above; STRENGTH is the head's volume in cells under a newton [m/N].
        head, bent: scratch, as large as a head and two cells more each way.
        balance: (6,), added to.

    Returns:
        Steps made, and calls found after the last of them.
    """
    done = found = 0
    while done < shares.shape[0] and found == 0:
        state, out = states[done], seen[done]
        finite = observe_at(wrench, immersion, block, state, out)
        if not finite or out[2] == 0.0 or out[16] >= 0.0:
            break
        if not undisturbed(common, common_a, common_b, state, numbers):
            break
        radius = max(math.sqrt(max(out[12], 0.0) / math.pi), 1e-9)
        reach = math.sqrt(2.0) * max(radius / numbers[SPACING], numbers[NARROWEST])
        x = (out[13] - numbers[ORIGIN_X]) / numbers[SPACING]
        y = (out[14] - numbers[ORIGIN_Y]) / numbers[SPACING]
        i, j = math.ceil(x - reach), math.ceil(y - reach)
        high, wide = math.floor(x + reach) - i + 1, math.floor(y + reach) - j + 1
        inside = nx == 0 or (-reach < x < nx - 1 + reach and -reach < y < ny - 1 + reach)
        if not inside or high > head.shape[0] or wide > head.shape[1]:
            break
        if not none_asleep(slots, first_a, first_b, i - 2, j - 2, high + 4, wide + 4):
            break

        step_tiles(z, prev, neighbours, 1, used, numbers[DAMP], numbers[SCALE], sides)
        z, prev = prev, z
        found = find_calls(z, neighbours, used, numbers[AMPLITUDE], calls)
        load = head[:high, :wide]
        fill_head(load, x - i, y - j, reach, numbers[STRENGTH] * out[2])
        power = (
            out[0] * state[12] + out[1] * state[13] + out[2] * state[14]
            + out[3] * state[15] + out[4] * state[16] + out[5] * state[17]
        )  # fmt: skip
        loss = max(-numbers[TIMESTEP] * power, 0.0)
        share, gained = press(
            z, prev, slots, first_a * TILE, first_b * TILE, i, j, nx, ny, load, NO_LAND, bent,
            numbers[EDGE], numbers[CORNER], numbers[WEIGHT], 0.0, loss,
        )  # fmt: skip
        impulse = numbers[TIMESTEP] * out[2]
        shares[done] = share
        balance[LOADS] += 1.0
        balance[LIMITED] += 1.0 if share < 1.0 else 0.0
        balance[LOST] += loss
        balance[GAINED] += gained
        balance[TAKEN] += impulse
        balance[GIVEN] += share * impulse
        done += 1
        call_address(hop, address_of(context), address_of(states[done]), 0)
    return done, found
