"""Bodies and moving water by the pure integrator: no MuJoCo, energy closed to rounding.

    half a free flight, a kick by loads and surface together, the surface's step, half a free flight

A free flight is exact (orientation to rounding), the kick is `mjskip.waves.coupling`. Second order in the step where
no face comes or goes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mjskip.errors import DivergedError
from mjskip.hydro import _block as hydro
from mjskip.hydro.columns import AIR_FORCE, WRENCH
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_and_immersion
from mjskip.rigid import _rigid_kernels as rigid
from mjskip.rigid.body import body_row, momenta
from mjskip.throws.throw import State
from mjskip.waves._coupling_kernels import free_flight
from mjskip.waves.coupling import LOAD_RADIUS, Loads, SurfaceCoupling, check_law
from mjskip.waves.window import Window

TURN = 0.01
"""Greatest angle of a step of the orientation: the spin's energy is then kept to 1e-12 a step."""


class TwoWayIntegrator:
    """Stones over a window of moving water, moved on step by step.

    Attributes:
        time: [s].
        window: the water.
        states: of the stones (n, 18).
        loads: of the last step; None before it.
        dissipated: energy that loads took from stones and water so far [J].
        worked: that air, buoyancy and skin friction gave to the stones [J].
        left: that shifts of the window left behind [J].
    """

    def __init__(
        self,
        stones: Sequence[Stone],
        starts: Sequence[State],
        *,
        window: Window,
        water: Water | None = None,
        timestep: float = 2e-4,
        gravity: float = 9.81,
        radius: float = LOAD_RADIUS,
        exact: bool = True,
        longest_face: float = 1.0,
    ) -> None:
        """Stones as they leave the hand.

        Args:
            stones: the bodies.
            starts: of each.
            window: of water; it follows the middle of the stones.
            water: the fluid; `Water()` if omitted. Faces are loaded while they advance against the surface
                there, whatever its gate; buoyancy and skin friction are those of still water.
            timestep: [s].
            gravity: downwards, as the window's [m/s^2].
            radius: of the bumps that spread loads [m].
            exact: whether the response is the window's own on its cells, with which energy closes to rounding, or
                that of cells without end, which is found sooner.
            longest_face: longest edge of a face, in radii; the plugin has 2.

        Raises:
            ValueError: a law that cannot be coupled, or a step too large for the window.
        """
        water = water or Water()
        check_law(water.law)
        if water.added_mass:
            raise ValueError("added_mass is not 0: moving water has its own, leave it at 0 over it")
        if not timestep < window.max_timestep:
            raise ValueError(
                f"timestep is {timestep:g} s: this window needs one below {window.max_timestep:.3g} s"
            )
        self.window, self.time, self._timestep = window, 0.0, timestep
        blocks = [pack(stone, water, gravity=gravity) for stone in stones]
        self.coupling = SurfaceCoupling(
            blocks, spacing=window.spacing, density=water.density, damping=window.damping, radius=radius,
            impulse=window.impulse() if exact else None,
            profile=None if exact else window.profile(radius), longest_face=longest_face,
        )  # fmt: skip
        self._others = [block.copy() for block in blocks]
        for block in self._others:  # what is left: air, buoyancy and skin friction
            block[[hydro.NORMAL_SQUARED, hydro.SPEED_NORMAL, hydro.CAVITY]] = 0.0
            block[[hydro.FORWARD, hydro.QUADRATURE]] = 0.0
        self._gravity = gravity
        self._masses = np.array([stone.mass for stone in stones])
        self._rows = np.array(
            [body_row(s.mass, s.inertia, gravity=(0.0, 0.0, -gravity)) for s in stones]
        )
        self._y = np.array(
            [
                momenta(
                    stone.mass, stone.inertia, position=start.position, q=start.q,
                    velocity=start.velocity, omega=start.omega,
                )
                for stone, start in zip(stones, starts, strict=True)
            ]
        )  # fmt: skip
        self.states = np.empty((len(stones), 18))
        self.loads: Loads | None = None
        self.dissipated = self.worked = self.left = 0.0
        self._look()

    def step(self) -> None:
        """Move on by one step.

        Raises:
            DivergedError: the motion is no longer finite.
        """
        dt, window = self._timestep, self.window
        self._fly(0.5 * dt)
        self._look()
        if not np.isfinite(self.states).all():
            raise DivergedError(f"the motion is no longer finite at {self.time:.4g} s")
        before = window.energy(dt)
        window.follow(*self.states[:, :2].mean(axis=0))
        self.left += before - window.energy(dt)
        others = np.zeros((len(self._y), AIR_FORCE))
        for n, block in enumerate(self._others):
            wrench = wrench_and_immersion(block, self.states[n : n + 1])[0, :WRENCH]
            others[n] = wrench[:AIR_FORCE] + wrench[AIR_FORCE:]
        old = self.states[:, 12:].copy()
        self.loads = self.coupling.kick(
            self._y, window.surface(dt), dt, rows=self._rows, others=others
        )
        window.step(dt, self.loads.pressure)
        self._look()
        self.dissipated += dt * self.loads.dissipation
        self.worked += dt * float(np.sum(others * 0.5 * (old + self.states[:, 12:])))
        self._fly(0.5 * dt)
        self._look()
        self.time += dt

    @property
    def energy(self) -> float:
        """Of stones and window now [J]."""
        return self.stone_energy + self.window.energy(self._timestep)

    @property
    def stone_energy(self) -> float:
        """Kinetic and potential energy of the stones [J]."""
        kinetic = 0.5 * np.sum(self._y[:, 7:13] * self.states[:, 12:18])
        return float(kinetic + self._gravity * np.dot(self._masses, self.states[:, 2]))

    @property
    def imbalance(self) -> float:
        """Energy of stones and water, and all that left them, less what air and buoyancy gave [J]: constant."""
        lost = self.dissipated + self.window.absorbed + self.left
        return self.energy + lost - self.worked

    def _fly(self, duration: float) -> None:
        scratch = np.empty(18)
        for row, y in zip(self._rows, self._y, strict=True):
            free_flight(row, y, duration, TURN, scratch)

    def _look(self) -> None:
        for row, y, state in zip(self._rows, self._y, self.states, strict=True):
            rigid.motion(row, y, state)
