"""Two-way water: stones feel the waves, and the waves are theirs.

Before every step a small patch of the surface is copied around each stone, where the force kernel reads
elevation and vertical speed; the surface stays frozen over the step, sub-stages included. After it the water
gets the reaction of the vertical force as pressure head,

    z_tt = c^2 lap(z + p / (rho g)) - mu z_t,

and moves on by the same step. The kernel never needs to know how the lake is stored.

The force laws were written against the undisturbed level: the pressure on a face is measured on a stone that
makes its own dent. The equation is linear, so the response to the current touch of each stone lives in a
lake of its own, which merges into the common one when the stone has left. A stone feels the common lake and
the other stones' touches, and its own dent only if asked to.

Water that nobody is near catches up in longer steps: between two of them a wave moves by less than a cell.

Energy (linear theory) goes into the waves at the rate -integral of p z_t. It exceeds what the stone lost
only where the surface under a face outruns the face: there the head is cut down until it does not, exactly
for the discrete step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mjskip import _force_kernels as kernels
from mjskip.forces import observe
from mjskip.waves._stencil import SAFE_FRACTION
from mjskip.waves.dense import Head
from mjskip.waves.lake import Lake

Array = npt.NDArray[np.float64]

MERGE_AFTER = 0.010
"""Dry time after which a touch is over and its waves are the lake's [s]."""

NEAR = 0.02
"""Height above the waves (taken as twice as high as when last looked at) at which a stone is near [m]."""

STEPS_BETWEEN_MEASURES = 16
"""Steps between looks at how high the waves are, where water moves on step by step."""

MARGIN = 3
"""Cells of a patch beyond the sphere about a stone: it moves during a step, and slopes need neighbours."""


@dataclass
class Balance:
    """What passed between stones and water so far.

    Attributes:
        lost: energy that the stones lost to the water [J].
        gained: energy that the waves gained [J], by linear theory.
        taken: vertical impulse that the stones took from the water [N s].
        given: vertical impulse pressed on the water [N s].
        loads: loads pressed, one a wet stone and step.
        limited: how many of them were cut down because the surface would have outrun the stone.
    """

    lost: float = 0.0
    gained: float = 0.0
    taken: float = 0.0
    given: float = 0.0
    loads: int = 0
    limited: int = 0


class MovingSurface:
    """The water between stones and their lake.

    Call `look` with the states before a step and `advance` after it.
    """

    def __init__(
        self,
        lake: Lake,
        blocks: Mapping[str, Array],
        *,
        density: float = 1000.0,
        gravity: float = 9.81,
        own_dent: bool = False,
        strength: float = 1.0,
    ) -> None:
        """Put a patch of surface under every stone.

        Args:
            lake: the common water.
            blocks: of the stones, by name; their patch's address is written there.
            density: of the water [kg/m^3].
            gravity: [m/s^2].
            own_dent: whether a stone feels the response to its own current touch.
            strength: factor on the reaction; 1 is Newton's, 0 leaves the water alone.
        """
        self.lake = lake
        self.balance = Balance()
        self._common = _Water(lake)
        self._stones = {name: _Stone(block, lake) for name, block in blocks.items()}
        self._waters = [self._common, *(stone.own for stone in self._stones.values())]
        self._weight = density * gravity * lake.spacing**2
        self._gravity = gravity
        self._strength = strength
        self._own_dent = own_dent

    def look(self, states: Mapping[str, Array]) -> dict[str, Array]:
        """Copy the surface around every stone and observe the forces there.

        Args:
            states: (1, 18) by name.

        Returns:
            (1, 17) by name, as `mjskip.forces.observe`.
        """
        self._reach = NEAR + 2.0 * sum([water.highest for water in self._waters])
        return {
            name: stone.look(states[name], self._reach, self._waters, own_dent=self._own_dent)
            for name, stone in self._stones.items()
        }

    def steps_apart(self, timestep: float, most: int) -> int:
        """Steps for which no stone that was just looked at can come near the water: 1 .. most.

        It falls no faster than with four times the acceleration of gravity, lift included.
        """
        time = most * timestep
        for stone in self._stones.values():
            gap = stone.state[2] - stone.radius - self._reach
            if gap <= 0.0:
                return 1
            speed = abs(stone.state[14])
            time = min(
                time,
                2.0 * gap / (speed + math.sqrt(speed * speed + 8.0 * abs(self._gravity) * gap)),
            )
        return max(1, int(time / timestep))

    def advance(self, timestep: float) -> dict[str, float]:
        """Press the reactions on the water and move it on [s].

        Returns:
            The share of each stone's reaction that the water was given, by name: 1 where not cut down.
        """
        moved: list[_Water] = []
        loads: list[tuple[str, _Stone, Head]] = []
        for name, stone in self._stones.items():
            stone.dry_for = 0.0 if stone.seen[16] < 0.0 else stone.dry_for + timestep
            if stone.touching and stone.dry_for >= MERGE_AFTER:
                self._merge(stone)
            head = self._head(stone) if stone.seen[2] != 0.0 else None
            if head is not None:
                stone.own.catch_up()
                loads.append((name, stone, head))
                moved += [water for water in (stone.own, *stone.felt) if water not in moved]
        for water in self._waters:
            if water in moved:
                water.step(timestep)
            else:
                water.wait(timestep)
        shares = dict.fromkeys(self._stones, 1.0)
        for name, stone, head in loads:
            shares[name] = self._press(stone, head, moved, timestep)
        return shares

    def settle(self) -> None:
        """Bring the lake to the present and merge every touch into it: to look at it as a whole."""
        self._common.catch_up()
        for stone in self._stones.values():
            if stone.touching:
                self._merge(stone)

    def _merge(self, stone: _Stone) -> None:
        """A touch is over: its waves are the lake's."""
        self._common.catch_up()
        stone.own.catch_up()
        self.lake.absorb(stone.own.lake)
        self._common.measure()
        stone.own.measure()
        stone.touching = False

    def _head(self, stone: _Stone) -> Head | None:
        """The head of a stone's reaction."""
        radius = math.sqrt(max(stone.seen[12], 0.0) / math.pi)
        return self.lake.head(
            stone.seen[13],
            stone.seen[14],
            radius=max(radius, 1e-9),
            volume=self._strength * stone.seen[2] / self._weight,
        )

    def _press(self, stone: _Stone, head: Head, moved: list[_Water], timestep: float) -> float:
        """Press one head on the water after its free step; the share of it that was pressed."""
        fx, fy, fz, tx, ty, tz = stone.seen[:6]
        vx, vy, vz, wx, wy, wz = stone.state[12:18]
        # what the paper's gate gives to a stone is not the waves' to give: they lose nothing for it
        power = fx * vx + fy * vy + fz * vz + tx * wx + ty * wy + tz * wz
        loss = max(-timestep * power, 0.0)
        elsewhere = 0.0
        for water in moved:
            if water is not stone.own and water.lake.awake_tiles:
                elsewhere += water.lake.work_under(head)
        share, gained = stone.own.lake.press_after(
            head, timestep, weight=self._weight, elsewhere=elsewhere, loss=loss
        )
        stone.touching = True
        balance, impulse = self.balance, timestep * fz
        balance.loads += 1
        balance.limited += share < 1.0
        balance.lost += loss
        balance.gained += gained
        balance.taken += impulse
        balance.given += share * impulse
        return share


class _Water:
    """A lake that may be behind the time, by less than its largest step.

    Attributes:
        highest: greatest |elevation| when it last caught up, or up to 16 steps ago [m].
    """

    def __init__(self, lake: Lake) -> None:
        self.lake = lake
        self._behind = 0.0
        self._patience = SAFE_FRACTION * lake.max_timestep
        self._steps = 0
        self.measure()

    def step(self, timestep: float) -> None:
        """Move on from the present [s]."""
        self.lake.step(timestep)
        self._moved()

    def wait(self, timestep: float) -> None:
        """Let time pass [s]."""
        if self._behind + timestep > self._patience:
            self.catch_up()
        self._behind += timestep

    def catch_up(self) -> None:
        """Come to the present."""
        if self._behind > 0.0:
            self.lake.advance(self._behind)
            self._behind = 0.0
            self._moved()

    def _moved(self) -> None:
        self._steps += 1
        if self._steps % STEPS_BETWEEN_MEASURES == 0:
            self.measure()

    def measure(self) -> None:
        """How high the waves are now."""
        self.highest = self.lake.highest


class _Stone:
    """A stone's block, its patch of surface, and the waves of its current touch.

    Attributes:
        felt: waters that move in its patch.
        state, seen: its state (18,) and what was observed there (17,), when last looked at.
    """

    state: list[float]
    seen: list[float]

    def __init__(self, block: Array, lake: Lake) -> None:
        self.block = block
        self.own = _Water(lake.sibling())
        self.felt: list[_Water] = []
        self.touching = False
        self.dry_for = math.inf
        self.radius = float(block[kernels.RADIUS])
        half = math.ceil(self.radius / lake.spacing) + MARGIN
        self._side = side = 2 * half + 1
        self._patch = np.zeros(kernels.PATCH_POINTS + 2 * side**2)
        self._points = self._patch[kernels.PATCH_POINTS :].reshape(2, side, side)
        self._patch[kernels.PATCH_RATE] = 1.0 / lake.spacing
        self._patch[kernels.PATCH_NX] = self._patch[kernels.PATCH_NY] = side
        self._address = np.array([self._patch.ctypes.data], dtype=np.int64).view(np.float64)[0]

    def look(self, states: Array, reach: float, waters: list[_Water], *, own_dent: bool) -> Array:
        """Observe the forces (1, 17) at a state (1, 18), on waves if it is lower than this over them."""
        self.state = states[0].tolist()
        self.felt.clear()
        self.block[kernels.SURFACE] = 0.0  # still water
        if self.state[2] < self.radius + reach:
            self._copy_patch([w for w in waters if own_dent or w is not self.own])
        seen = observe(self.block, states)
        self.seen = seen[0].tolist()
        return seen

    def _copy_patch(self, waters: list[_Water]) -> None:
        """Feel the sum of some waters; still water if none moves there."""
        lake, side, patch = self.own.lake, self._side, self._patch
        x, y = lake.cell_at(self.state[0], self.state[1])
        if not (math.isfinite(x) and math.isfinite(y)):
            return
        i, j = round(x) - side // 2, round(y) - side // 2
        self.felt += [water for water in waters if water.lake.stirs(i, j, side)]
        if not self.felt:
            return
        self._points[...] = 0.0
        for water in self.felt:
            water.catch_up()
            patch[kernels.PATCH_HIGHEST] = water.lake.add_to_patch(i, j, self._points)
        patch[kernels.PATCH_X], patch[kernels.PATCH_Y] = lake.place_of(i, j)
        self.block[kernels.SURFACE] = self._address
