"""What a robot in a scene does: control signals over time, and grips that let go.

A scene says it in <custom>, in SI units:

    <numeric name="mjskip.control.shoulder" data="0 0  .25 9  .5 0"/>    times and values of an actuator
    <numeric name="mjskip.release.grip" data=".25"/>                     when an equality is switched off
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from mjskip.coupling.bodies import body_name

ROUNDING = 1e-9
"""Times that are sums of steps are late or early by less than this [s]."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """Control signals of a model, and when its grips let go.

    Attributes:
        controls: by actuator, times [s] and values in turn; linear between, constant outside.
        release_times: by equality, when it is switched off [s].

    Raises:
        ValueError: a signal is not pairs with times that increase.
    """

    controls: Mapping[str, tuple[float, ...]]
    release_times: Mapping[str, float]

    def __post_init__(self) -> None:
        for name, signal in self.controls.items():
            if len(signal) < 2 or len(signal) % 2 or not np.all(np.diff(signal[::2]) > 0.0):
                raise ValueError(
                    f"control.{name} is {' '.join(f'{value:g}' for value in signal)}: give a time and a "
                    "value in turn, times increasing"
                )

    def held(self, model: mujoco.MjModel) -> frozenset[str]:
        """Names of the bodies that the arm holds until it lets go."""
        ids = set()
        for name in self.release_times:
            equality = model.equality(name)
            if model.eq_objtype[equality.id] == mujoco.mjtObj.mjOBJ_BODY:
                ids |= {int(model.eq_obj1id[equality.id]), int(model.eq_obj2id[equality.id])}
        return frozenset(body_name(model, body) for body in ids)

    def act(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set controls and equalities for the step that begins at the data's time."""
        now = data.time + ROUNDING
        for name, signal in self.controls.items():
            data.ctrl[model.actuator(name).id] = np.interp(now, signal[::2], signal[1::2])
        for name, when in self.release_times.items():
            if now >= when:
                data.eq_active[model.equality(name).id] = 0
