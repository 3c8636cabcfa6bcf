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
from mjskip.lakes import Lake

Array = npt.NDArray[np.float64]
Head = tuple[npt.NDArray[np.float32], int, int]
"""Heights (nx, ny) [m] of a load on the water, and its first cell."""

MERGE_AFTER = 0.010
"""Dry time after which a touch is over and its waves are the lake's [s]."""

NEAR = 0.02
"""Height above the waves (taken as twice as high as when last looked at) at which a stone is near [m]."""

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
        self._stones = {name: _Stone(block, lake) for name, block in blocks.items()}
        self._head = strength / (density * gravity * lake.spacing**2)
        self._weight = density * gravity * lake.spacing**2
        self._own_dent = own_dent
        self._pending = 0.0
        self._highest = lake.highest

    def look(self, states: Mapping[str, Array]) -> dict[str, Array]:
        """Copy the surface around every stone and observe the forces there.

        Args:
            states: (1, 18) by name.

        Returns:
            (1, 17) by name, as `mjskip.forces.observe`.
        """
        near = {n: s for n, s in self._stones.items() if states[n][0, 2] < self._reach(s)}
        if near:
            self._catch_up()
        for name, stone in self._stones.items():
            if name in near:
                others = [s.own for n, s in self._stones.items() if n != name or self._own_dent]
                stone.copy_patch(states[name][0], [self.lake, *others])
            else:
                stone.forget_patch()
        self._seen = {name: observe(s.block, states[name]) for name, s in self._stones.items()}
        self._states = {name: states[name][0] for name in states}
        return self._seen

    def advance(self, timestep: float) -> dict[str, float]:
        """Press the reactions on the water and move it on [s].

        Returns:
            The share of each stone's reaction that the water was given, by name: 1 where not cut down.
        """
        loaded = {n: s for n, s in self._stones.items() if self._seen[n][0, 2] != 0.0}
        for name, stone in self._stones.items():
            stone.dry_for = 0.0 if self._seen[name][0, 16] < 0.0 else stone.dry_for + timestep
            if stone.touching and stone.dry_for >= MERGE_AFTER:
                self._catch_up()
                self.lake.absorb(stone.own)
                stone.touching = False
        shares = dict.fromkeys(self._stones, 1.0)
        if not loaded:
            self._pending += timestep  # nobody looks: the water catches up in longer steps
            return shares
        self._catch_up()
        fields = [self.lake, *(s.own for s in self._stones.values())]
        heads = {name: self._load(name, stone) for name, stone in loaded.items()}
        before = {name: _gather(fields, head) for name, head in heads.items()}
        for field in fields:
            field.step(timestep)
        for name, stone in loaded.items():
            shares[name] = self._press(name, stone, fields, heads[name], before[name], timestep)
            stone.touching = True
        return shares

    def settle(self) -> None:
        """Bring the lake to the present and merge every touch into it: to look at it as a whole."""
        self._catch_up()
        for stone in self._stones.values():
            if stone.touching:
                self.lake.absorb(stone.own)
                stone.touching = False

    def _reach(self, stone: _Stone) -> float:
        """Height of the centre of mass below which a stone might touch [m]."""
        return float(stone.block[kernels.RADIUS]) + NEAR + 2.0 * self._highest

    def _catch_up(self) -> None:
        if self._pending > 0.0:
            for field in [self.lake, *(s.own for s in self._stones.values())]:
                field.advance(self._pending)
            self._pending = 0.0
            self._highest = sum(
                f.highest for f in (self.lake, *(s.own for s in self._stones.values()))
            )

    def _load(self, name: str, stone: _Stone) -> Head:
        """The head (nx, ny) [m] of a stone's reaction and its first cell."""
        seen = self._seen[name][0]
        radius = math.sqrt(max(float(seen[12]), 0.0) / math.pi)
        found = self.lake.head(
            float(seen[13]),
            float(seen[14]),
            radius=max(radius, 1e-9),
            volume=self._head * float(seen[2]),
        )
        return found or (np.zeros((0, 0), np.float32), 0, 0)

    def _press(
        self,
        name: str,
        stone: _Stone,
        fields: list[Lake],
        head: Head,
        before: Array,
        timestep: float,
    ) -> float:
        """Press one head on the water after its free step; the share of it that was pressed.

        With heads h, the waves gain W = -rho g d^2 sum h (z+ - z) over the step. The free step gives
        z+ - z = D; a share s of the head adds s L(h), so W(s) = -rho g d^2 (s sum h D + s^2 sum h L(h)).
        """
        seen, state = self._seen[name][0], self._states[name]
        # what the paper's gate gives to a stone is not the waves' to give: they lose nothing for it
        loss = -timestep * float(seen[0:3] @ state[12:15] + seen[3:6] @ state[15:18])
        loss = max(loss, 0.0)
        heights, i, j = head
        bent = stone.own.bend(heights, timestep)
        core = bent[1:-1, 1:-1]
        linear = -self._weight * float(np.sum(heights * (_gather(fields, head) - before)))
        square = -self._weight * float(np.sum(heights * core))
        share = _largest_share(linear, square, loss)
        stone.own.add_elevation(np.float32(share) * bent, i - 1, j - 1)
        balance = self.balance
        balance.loads += 1
        balance.limited += share < 1.0
        balance.lost += loss
        balance.gained += share * linear + share**2 * square
        balance.taken += timestep * float(seen[2])
        balance.given += share * timestep * float(seen[2])
        return share


class _Stone:
    """A stone's block, its patch of surface, and the waves of its current touch."""

    def __init__(self, block: Array, lake: Lake) -> None:
        self.block = block
        self.own = lake.sibling()
        self.touching = False
        self.dry_for = math.inf
        half = math.ceil(block[kernels.RADIUS] / lake.spacing) + MARGIN
        self._side = 2 * half + 1
        self._patch = np.zeros(kernels.PATCH_POINTS + 2 * self._side**2)
        self._patch[kernels.PATCH_RATE] = 1.0 / lake.spacing
        self._patch[kernels.PATCH_NX] = self._patch[kernels.PATCH_NY] = self._side
        self._address = np.array([self._patch.ctypes.data], dtype=np.int64).view(np.float64)[0]

    def copy_patch(self, state: Array, fields: list[Lake]) -> None:
        """The sum of some waters around a state."""
        side, patch = self._side, self._patch
        points = patch[kernels.PATCH_POINTS :].reshape(2, side, side)
        points[...] = 0.0
        moving = [field for field in fields if field.awake_tiles]
        if not moving:
            self.forget_patch()
            return
        for field in moving:
            x, y = field.add_block(float(state[0]), float(state[1]), points)
        patch[kernels.PATCH_X], patch[kernels.PATCH_Y] = x, y
        patch[kernels.PATCH_HIGHEST] = np.abs(points[0]).max()
        self.block[kernels.SURFACE] = self._address

    def forget_patch(self) -> None:
        """Still water."""
        self.block[kernels.SURFACE] = 0.0


def _gather(fields: list[Lake], head: Head) -> Array:
    """The sum of the elevations under a head."""
    heights, i, j = head
    total = np.zeros(heights.shape)
    for field in fields:
        if field.awake_tiles:
            total += field.cells(i, j, heights.shape)
    return total


def _largest_share(linear: float, square: float, loss: float) -> float:
    """Largest s in [0, 1] with s linear + s^2 square <= loss; square and loss are at least 0."""
    if linear + square <= loss:
        return 1.0
    root = math.sqrt(linear * linear + 4.0 * square * loss)
    if linear > 0.0:
        return 2.0 * loss / (linear + root)
    return 0.5 * (root - linear) / square
