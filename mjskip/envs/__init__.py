"""Gymnasium environments over water; importing this package registers them.

    import gymnasium
    import mjskip.envs

    env = gymnasium.make("mjskip/Thrower-v0")

Gymnasium 1.0 took away the loading of environments by entry points of other packages, so something has to import
this package once. `gymnasium.make("mjskip.envs:mjskip/Thrower-v0")` does that by itself.
"""

from __future__ import annotations

from gymnasium.envs.registration import register, registry

ENVIRONMENTS: dict[str, tuple[str, int | None]] = {
    "ThrowStone": ("mjskip.envs.throw_stone", None),
    "Thrower": ("mjskip.envs.thrower", 1000),
    "Float": ("mjskip.envs.float", 400),
    "Wade": ("mjskip.envs.wade", 500),
}
"""By name: the module with the classes <Name>Env and <Name>VectorEnv, and after how many steps an episode is
cut off."""


def _register() -> None:
    for name, (module, steps) in ENVIRONMENTS.items():
        if f"mjskip/{name}-v0" not in registry:
            register(
                id=f"mjskip/{name}-v0",
                entry_point=f"{module}:{name}Env",
                vector_entry_point=f"{module}:{name}VectorEnv",
                max_episode_steps=steps,
            )


_register()
