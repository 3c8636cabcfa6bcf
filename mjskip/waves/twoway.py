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
import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mjskip.errors import MjskipWarning
from mjskip.hydro import _block as kernels
from mjskip.hydro.wrench import immersion_address, wrench_address, wrench_and_immersion
from mjskip.waves import _lake_kernels as tiles
from mjskip.waves._grid import free_memory
from mjskip.waves._stencil import SAFE_FRACTION
from mjskip.waves.dense import Head
from mjskip.waves.lake import Lake
from mjskip.waves.ride import Ride

Array = npt.NDArray[np.float64]

Hop = tuple[int, Array]
"""Address of what steps an engine of one stone, and its context: see `mjskip.coupling._free_joint_kernels.hop`."""

MERGE_AFTER = 0.010
"""Dry time after which a touch is over and its waves are the lake's [s]."""

NEAR = 0.02
"""Clearance above the waves (taken as twice as high as when last measured) at which a stone is near [m]."""

STEPS_BETWEEN_MEASURES = 16
"""Steps between looks at how high the waves are, where water moves on step by step."""

MANY_CELLS = 400
"""Cells across a stone's patch beyond which a step takes longer than the water around it."""

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

    def take(self, more: Array) -> None:
        """Add what a glide has counted, and set that to zero."""
        self.loads += int(more[tiles.LOADS])
        self.limited += int(more[tiles.LIMITED])
        self.lost += float(more[tiles.LOST])
        self.gained += float(more[tiles.GAINED])
        self.taken += float(more[tiles.TAKEN])
        self.given += float(more[tiles.GIVEN])
        more[:] = 0.0


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
        for stone in self._stones.values():
            stone.near = [water for water in self._waters if own_dent or water is not stone.own]
        self._weight = density * gravity * lake.spacing**2
        self._strength = strength
        self._own_dent = own_dent
        self._hop: Hop | None = None

    def look(self, states: Mapping[str, Array]) -> dict[str, Array]:
        """Copy the surface around every stone and observe the forces there.

        Args:
            states: (1, 18) by name.

        Returns:
            (1, 17) by name, as `mjskip.hydro.wrench.wrench_and_immersion`.
        """
        return {name: stone.look(states[name]) for name, stone in self._stones.items()}

    def glide(
        self, hop: Hop, states: Mapping[str, Array], timestep: float, most: int
    ) -> dict[str, tuple[Array, Array, Array]] | None:
        """Steps in compiled code, as `look`, `advance` and the engine make them one by one.

        Only a single stone can do so: while it is in the air over still water, or touches water that it alone
        moves.

        Args:
            hop: what steps the engine, the same object in every call.
            states: (1, 18) by name.
            timestep: [s], the same in every call.
            most: steps.

        Returns:
            By name: states (n + 1, 18), beginning with those given, what was observed (n, 17) and shares
            (n,) given to the water; None if it cannot be done now.
        """
        if len(self._stones) != 1 or self._own_dent:
            return None
        ((name, stone),) = self._stones.items()
        most = min(most, *[water.steps_waiting(timestep) for water in self._waters])
        if most < 1:
            return None
        if stone.ride is None or hop is not self._hop:
            self._hop = hop
            stone.ride = Ride(
                (*hop, wrench_address(), immersion_address(), stone.block),
                stone.own.lake,
                self.lake,
                timestep=timestep,
                radius=stone.radius,
                side=stone.side,
                weight=self._weight,
                strength=self._strength / self._weight,
            )
        stone.block[kernels.SURFACE] = 0.0
        path, seen, shares = np.empty((most + 1, 18)), np.empty((most, 17)), np.ones(most)
        path[0] = states[name][0]
        done = 0
        if stone.touching and stone.dry_for == 0.0 and not stone.own.is_behind:
            done = stone.ride.glide(path, seen, shares)
        still = [self._common]
        if done:
            stone.own.moved(done)
            self.balance.take(stone.ride.balance)
        else:
            if stone.touching:  # until its waves merge into the lake
                most = min(most, int((MERGE_AFTER - stone.dry_for) / timestep - 0.5))
            done = stone.ride.fly(path, seen[: max(most, 0)], stone.reach())
            stone.dry_for += done * timestep
            still = self._waters
        for water in still:
            for _ in range(done):
                water.wait(timestep)
        return {name: (path[: done + 1], seen[:done], shares[:done])} if done else None

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
        self.moved(1)

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
            self.moved(1)

    @property
    def is_behind(self) -> bool:
        """Whether it is behind the time."""
        return self._behind > 0.0

    def steps_waiting(self, timestep: float) -> int:
        """Steps for which it can wait without catching up."""
        return int((self._patience - self._behind) / timestep)

    def moved(self, steps: int) -> None:
        """It was moved on by some steps, a few at most."""
        self._steps += steps
        if self._steps % STEPS_BETWEEN_MEASURES < steps:
            self.measure()

    def measure(self) -> None:
        """How high the waves are now."""
        self.highest = self.lake.highest


class _Stone:
    """A stone's block, its patch of surface, and the waves of its current touch.

    Attributes:
        near: waters that it can feel; felt: those of them that move in its patch.
        side: of that, in cells.
        ride: what it needs to glide.
        state, seen: its state (18,) and what was observed there (17,), when last looked at.
    """

    state: list[float]
    seen: list[float]

    def __init__(self, block: Array, lake: Lake) -> None:
        self.block = block
        self.own = _Water(lake.sibling())
        self.near: list[_Water] = []
        self.felt: list[_Water] = []
        self.touching = False
        self.ride: Ride | None = None
        self.dry_for = math.inf
        self.radius = float(block[kernels.RADIUS])
        half = math.ceil(self.radius / lake.spacing) + MARGIN
        self.side = side = 2 * half + 1
        size = 16 * side * side
        if size > 0.9 * free_memory():
            raise ValueError(
                f"a stone of {self.radius:g} m covers {side} x {side} cells of {lake.spacing:g} m, and the surface "
                f"under it would take {size / 1e9:.3g} GB: use a larger spacing"
            )
        if side > MANY_CELLS:
            warnings.warn(
                f"a stone of {self.radius:g} m covers {side} x {side} cells of {lake.spacing:g} m: that is slow; a "
                "larger spacing would do",
                MjskipWarning,
                stacklevel=2,
            )
        self._patch = np.zeros(kernels.PATCH_POINTS + 2 * side**2)
        self._points = self._patch[kernels.PATCH_POINTS :].reshape(2, side, side)
        self._patch[kernels.PATCH_RATE] = 1.0 / lake.spacing
        self._patch[kernels.PATCH_NX] = self._patch[kernels.PATCH_NY] = side
        self._address = np.array([self._patch.ctypes.data], dtype=np.int64).view(np.float64)[0]

    def reach(self) -> float:
        """Clearance above the level at which it may be near the waves [m]."""
        return NEAR + 2.0 * sum([water.highest for water in self.near])

    def look(self, states: Array) -> Array:
        """Observe the forces (1, 17) at a state (1, 18), on the waves if it is near them."""
        self.state = states[0].tolist()
        self.felt.clear()
        self.block[kernels.SURFACE] = 0.0  # still water
        seen = wrench_and_immersion(self.block, states)
        if seen[0, 16] < self.reach() and self._copy_patch():
            seen = wrench_and_immersion(self.block, states)
        self.seen = seen[0].tolist()
        return seen

    def _copy_patch(self) -> bool:
        """Feel the sum of the waters that move here, if any does."""
        lake, side, patch = self.own.lake, self.side, self._patch
        x, y = lake.cell_at(self.state[0], self.state[1])
        if not (math.isfinite(x) and math.isfinite(y)):
            return False
        i, j = round(x) - side // 2, round(y) - side // 2
        self.felt += [water for water in self.near if water.lake.stirs(i, j, side)]
        if not self.felt:
            return False
        self._points[...] = 0.0
        for water in self.felt:
            water.catch_up()
            patch[kernels.PATCH_HIGHEST] = water.lake.add_to_patch(i, j, self._points)
        patch[kernels.PATCH_X], patch[kernels.PATCH_Y] = lake.place_of(i, j)
        self.block[kernels.SURFACE] = self._address
        return True
