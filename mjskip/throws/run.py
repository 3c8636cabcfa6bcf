"""A run: stones and their water, moved on together block by block. `simulate` and the viewer are built on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mjskip._typing import Array
from mjskip.errors import MjskipError
from mjskip.hydro.columns import load_columns
from mjskip.hydro.wrench import pack, wrench_and_immersion
from mjskip.throws.engines import Engine
from mjskip.throws.scene import Scene
from mjskip.waves.coupled import CoupledWater
from mjskip.waves.coupling import LOAD_RADIUS
from mjskip.waves.driven import DrivenWater
from mjskip.waves.field import HeightField
from mjskip.waves.recording import SurfaceRecorder


class Block(NamedTuple):
    """Some steps of n stones: what there was at the beginning of each.

    Attributes:
        states: (m, n, 18), see `mjskip.rigid.state`.
        loads: (m, n, 17), see `mjskip.hydro.columns`.
        reactions: vertical force that the water was given over each step (m, n), downwards [N].
    """

    states: Array
    loads: Array
    reactions: Array


class Run:
    """Stones in motion, over still water, over still water that shows their rings, or over waves.

    Attributes:
        engine: what moves the stones; it must be open.
        field: the water; None over still water that nobody looks at. Up to date after `show`.
    """

    def __init__(
        self,
        scene: Scene,
        engine: Engine,
        timestep: float,
        *,
        field: HeightField | None,
        feel: bool,
        load_radius: float = LOAD_RADIUS,
        recorder: SurfaceRecorder | None = None,
    ) -> None:
        """Begin a run.

        Args:
            scene: of the stones.
            engine: with them in it.
            timestep: [s].
            field: the water, or None.
            feel: whether the stones feel it, or only press on it.
            load_radius: see `CoupledWater`.
            recorder: keeps the surface.

        Raises:
            ValueError: the water cannot be coupled to the stones.
        """
        self.engine, self.field, self._states = engine, field, engine.states()
        gravity = float(-scene.model.opt.gravity[2])
        self._blocks = [
            pack(scene.stones[name], scene.water_of(name), gravity=gravity) for name in engine.names
        ]
        self._water: CoupledWater | DrivenWater | None = None
        if field is not None and feel:
            self._water = CoupledWater(
                field, self._blocks, timestep=timestep, density=scene.water.density, gravity=gravity,
                stages=engine.stages, load_radius=load_radius, recorder=recorder,
            )  # fmt: skip
            engine.couple(self._water)
        elif field is not None:
            self._water = DrivenWater(
                field, timestep=timestep, density=scene.water.density, recorder=recorder
            )

    def advance(self, steps: int) -> Block:
        """Move on.

        Raises:
            DivergedError: a force or a state is not finite.
        """
        if isinstance(self._water, CoupledWater):
            parts = steps if self.engine.acts else 1
            blocks = []
            for _ in range(parts):
                self.engine.before_step()
                path, loads, reactions = self._water.advance(
                    self.engine, self._states, steps // parts
                )
                self._states = path[-1]
                self.engine.after_step()
                blocks.append((path[:-1], loads, reactions))
            block = Block(*(np.concatenate(part) for part in zip(*blocks, strict=True)))
            self.engine.check()
            return block
        path = np.concatenate([self._states[None], self.engine.advance(steps)])
        self._states = path[-1]
        self.engine.check()
        block = self._over_still_water(path[:-1])
        if self._water is not None:
            columns = load_columns(block.loads)
            self._water.extend(block.reactions, columns.wetted_centre[..., :2], columns.wetted_area)
        return block

    def _over_still_water(self, states: Array) -> Block:
        states = np.ascontiguousarray(states.swapaxes(0, 1))
        with np.errstate(all="ignore"):
            loads = np.stack(
                [wrench_and_immersion(b, s) for b, s in zip(self._blocks, states, strict=True)],
                axis=1,
            )
        return Block(states.swapaxes(0, 1), loads, load_columns(loads).force[..., 2])

    def show(self) -> HeightField:
        """The water, up to date."""
        if self.field is None or self._water is None:
            raise MjskipError("this run has no water to show")
        self._water.catch_up()
        return self.field

    def finish(self) -> None:
        """After the last step: let the recorder follow the rings as long as it wants to."""
        if self._water is not None:
            self._water.finish()
