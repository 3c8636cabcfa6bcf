"""Gymnasium environments: they keep Gymnasium's contract, repeat themselves, and do what the physics says."""

import math
import os
import shutil
import subprocess
import sys

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from mjskip import Throw, Water, load_scene, simulate
from mjskip.envs.throw_stone import ACTIONS

NAMES = ["ThrowStone", "Thrower", "Float", "Wade"]
REQUIRED = os.environ.get("MJSKIP_REQUIRE_BROWSER")


def make(name, **options):
    """The environment itself, without Gymnasium's wrappers."""
    return gymnasium.make(f"mjskip/{name}-v0", **options).unwrapped


def many(name, count, mode="vector_entry_point", **options):
    return gymnasium.make_vec(
        f"mjskip/{name}-v0", num_envs=count, vectorization_mode=mode, **options
    )


def run(env, actions, seed=0):
    """Everything an environment says to these actions, as one array of doubles."""
    said = [env.reset(seed=seed)[0]]
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        if isinstance(env.unwrapped, gymnasium.Env) and (terminated or truncated):
            observation = np.append(observation, env.reset()[0])
        numbers = [info[key] for key in sorted(info) if not key.startswith("_")]
        said += [observation, reward, terminated, truncated, *numbers]
    return np.concatenate([np.ravel(part).astype(np.float64) for part in said])


def random_actions(env, steps, seed=1):
    env.action_space.seed(seed)
    return [env.action_space.sample() for _ in range(steps)]


@pytest.mark.parametrize("name", NAMES)
def test_gymnasiums_own_checks_pass(name):
    env = make(name)
    check_env(env, skip_render_check=True)
    for space in (env.observation_space, env.action_space):
        assert space.is_bounded()
        assert len(space.shape) == 1
    assert env.step.__doc__
    env.close()


def test_the_first_gym_make_needs_no_import_of_ours():
    code = "import gymnasium; e = gymnasium.make('mjskip:mjskip/Float-v0'); print(e.reset(seed=0)[0].shape)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "(14,)"


@pytest.mark.parametrize("name", NAMES)
def test_the_same_seed_gives_the_same_bytes(name):
    env, other = make(name), make(name)
    actions = random_actions(env, 3 if name == "ThrowStone" else 60)
    first = run(env, actions, seed=5)
    assert run(env, actions, seed=5).tobytes() == first.tobytes()
    assert run(other, actions, seed=5).tobytes() == first.tobytes()
    if name != "Thrower":  # which starts as its scene does
        assert run(env, actions, seed=6).tobytes() != first.tobytes()


@pytest.mark.parametrize("name", NAMES)
def test_many_in_a_batch_are_those_one_by_one_to_the_bit(name):
    # long enough for episodes to end and begin anew
    steps, limit = (3, None) if name == "ThrowStone" else (60, 25)
    batch = many(name, 3, num_threads=2, max_episode_steps=limit)
    single = many(name, 3, "sync", max_episode_steps=limit)
    actions = random_actions(single, steps)
    np.testing.assert_array_equal(run(batch, actions, 7), run(single, actions, 7))
    assert batch.single_observation_space == single.single_observation_space
    batch.close()
    single.close()


@pytest.mark.slow
@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_environments_in_other_processes_are_the_same(start):
    def one():  # a spawned process knows nothing that it is not told
        return gymnasium.make("mjskip:mjskip/Float-v0")

    parallel = AsyncVectorEnv([one, one], context=start)
    single = SyncVectorEnv([one, one])
    actions = random_actions(single, 20)
    np.testing.assert_array_equal(run(parallel, actions), run(single, actions))
    parallel.close()
    single.close()


@pytest.mark.parametrize(
    ("speed", "spin", "attack", "descent"), [(12.0, 20.0, 20.0, 8.0), (8.0, 15.0, 25.0, 12.0)]
)
def test_a_thrown_stone_skips_as_often_and_flies_as_far_as_in_simulate(
    speed, spin, attack, descent
):
    throw = Throw.from_degrees(speed=speed, spin=spin, attack=attack, descent=descent)
    env = make("ThrowStone")
    height = float(env.reset(seed=3)[0][0])
    action = [
        2.0 * (getattr(throw, key) - low) / (high - low) - 1.0
        for key, (low, high) in ACTIONS.items()
    ]
    _, reward, terminated, _, info = env.step(np.array(action))
    flight = simulate(
        load_scene("lake").rethrow(
            speed=throw.speed, spin=throw.spin, attack=throw.attack, descent=throw.descent,
            bank=throw.bank, height=height,
        )
    )  # fmt: skip
    assert terminated
    assert info["skips"] == flight.skips > 0
    # the environment looks every 20 ms whether it is over
    assert info["distance"] == pytest.approx(
        flight.position[-1, 0] - flight.position[0, 0], abs=0.02 * speed
    )
    assert reward == pytest.approx(info["skips"] + 0.1 * info["distance"])


def test_the_arm_throws_as_in_its_scene():
    env = make("Thrower")
    arm = load_scene("thrower").arm
    largest = env.model.actuator_ctrlrange[:, 1]
    signals = [arm.controls[name] for name in ("shoulder", "elbow", "wrist")]
    env.reset(seed=0)
    total, over, step = 0.0, False, 0
    while not over and step < 1000:
        # the signal in the middle of the step, for which it is held
        now = (step + 0.5) * 0.005
        joints = [np.interp(now, s[::2], s[1::2]) for s in signals] / largest
        grip = 1.0 if step * 0.005 >= arm.release_times["grip"] - 1e-9 else -1.0
        _, reward, over, _, info = env.step(np.array([*joints, grip]))
        total, step = total + reward, step + 1
    flight = simulate("thrower")
    assert over
    assert info["release"] == pytest.approx(0.3)
    # signals held for 5 ms instead of followed: 1% of the speed
    assert info["speed"] == pytest.approx(flight.attributes["throw"]["speed"], rel=0.01)
    assert info["skips"] == flight.skips == 2
    assert total == pytest.approx(info["skips"] + 0.1 * info["distance"])


@pytest.mark.parametrize("vector", [False, True])
def test_a_stone_that_lands_on_the_bank_is_over_and_has_not_skipped_there(vector):
    env = many("Thrower", 1) if vector else make("Thrower")
    env.reset(seed=0)
    action = np.array([0.0, 0.0, 0.0, 1.0])
    env.step(action[None] if vector else action)
    simulation = env._episodes.simulation
    # down on the beach where it is dry or a centimetre under water
    for y, skips in ((9.0, 0), (5.6, 0)):
        env.reset(seed=0)
        env.step(action[None] if vector else action)
        simulation.qpos[0, 3:6] = [4.0, y, 0.5]
        simulation.qvel[0, :] = 0.0
        simulation.qvel[0, 5] = -3.0
        for _ in range(200):
            *_, terminated, _, info = env.step(action[None] if vector else action)
            if np.all(terminated):
                break
        assert np.all(terminated)
        assert info["skips"] == skips


def test_the_arms_limits_are_those_of_its_scene_and_its_own_throw_is_within_them():
    env, scene = make("Thrower"), load_scene("thrower")
    for field in ("actuator_ctrlrange", "actuator_forcerange", "actuator_gainprm", "body_mass"):
        np.testing.assert_array_equal(getattr(env.model, field), getattr(scene.model, field))
    data = mujoco.MjData(scene.model)
    while data.time < 0.6:
        scene.arm.act(scene.model, data)
        mujoco.mj_step(scene.model, data)
        assert np.all(np.abs(data.actuator_force) < scene.model.actuator_forcerange[:, 1])
        assert np.all(np.abs(data.ctrl) < scene.model.actuator_ctrlrange[:, 1])


def test_a_raft_at_its_station_stays_there_and_one_that_steers_gets_there():
    env = make("Float")
    observation, _ = env.reset(seed=2)
    for _ in range(400):
        ahead, left, sine, cosine = observation[:4]
        turn = math.atan2(sine, cosine)
        velocity, yaw = observation[8:11], observation[13]
        force = 2.0 * ahead - 5.0 * velocity[0]
        side = 2.0 * left - 5.0 * velocity[1]
        moment = 1.0 * turn - 1.5 * yaw
        action = [0.5 * force - 2 * moment, 0.5 * force + 2 * moment, side]
        observation, _, over, _, info = env.step(np.clip(action, -1, 1))
        assert not over
    assert info["distance"] < 0.1
    assert info["heading_error"] < 0.1
    # it floats where its weight is displaced: 45% of 0.16 m
    assert observation[4] == pytest.approx(0.008, abs=1e-3)


@pytest.mark.slow
def test_a_crawl_crosses_the_ford():
    env = many("Wade", 16, num_threads=2, max_episode_steps=500)
    env.reset(seed=3)
    phases = np.array([-0.2, 0.3, 0.37, 0.82])
    crossed = np.zeros(16, bool)
    frequency = np.linspace(2.8, 3.6, 16)
    for step in range(450):
        phase = 2.0 * np.pi * (frequency[:, None] * step * 0.04 + phases)
        action = np.empty((16, 8))
        action[:, ::2] = -0.24 * np.cos(phase) + 0.04
        action[:, 1::2] = -0.85 * np.maximum(0.0, np.sin(phase)) - 0.04
        info = env.step(action)[-1]
        crossed |= info["crossed"]
    assert crossed.any()


def test_options_change_water_and_stone_for_one_episode():
    env = make("ThrowStone")
    plain = env.reset(seed=0)[0]
    salty = env.reset(seed=0, options={"water": {"density": 1025.0}, "stone": {"radius": 0.03}})[0]
    assert salty[4] == 1025.0
    assert salty[1] / plain[1] == pytest.approx(0.03 / 0.045)
    assert salty[3] / plain[3] == pytest.approx((0.03 / 0.045) ** 2, rel=1e-5)  # mesh in floats
    np.testing.assert_array_equal(env.reset(seed=0)[0], plain)


REGULAR = {"height": 0.06, "period": 1.6, "direction": 0.7}


def drift(env, sea, steps=150, seed=4):
    """Heights and distances of a raft that does nothing, over 7.5 s."""
    env.reset(seed=seed, options=None if sea is None else {"sea": sea})
    seen = [env.step(np.zeros(3)) for _ in range(steps)]
    return np.array([[step[0][4], step[4]["distance"]] for step in seen])


def test_a_raft_rides_the_sea_that_a_reset_asks_for():
    env = make("Float")
    still, moved = drift(env, None), drift(env, REGULAR)
    late = slice(60, None)  # a wave of 4 m is followed by a raft of 0.8 m
    assert np.ptp(still[late, 0]) < 1e-3
    assert np.ptp(moved[late, 0]) == pytest.approx(0.06, rel=0.15)
    np.testing.assert_array_equal(drift(env, REGULAR), moved)
    # another episode meets the sea at another moment
    assert not np.array_equal(drift(env, REGULAR, seed=5)[:, 0], moved[:, 0])
    np.testing.assert_array_equal(drift(env, None), still)


def test_many_rafts_in_a_sea_are_those_one_by_one_to_the_bit():
    sea = "height=0.06 period=1.6 direction=40"
    batch = many("Float", 3, num_threads=2, max_episode_steps=12, sea=sea)
    single = many("Float", 3, "sync", max_episode_steps=12, sea=sea)
    actions = random_actions(single, 30)
    np.testing.assert_array_equal(run(batch, actions, 7), run(single, actions, 7))
    batch.close()
    single.close()
    still = many("Float", 2)
    with pytest.raises(ValueError, match="all episodes of a batch are in still water, or all in a"):
        still.reset(options={"sea": sea})
    still.reset(seed=0)
    still.step(np.zeros((2, 3)))


def test_ranges_are_drawn_anew_for_every_episode():
    env = make("Float", water={"density": (900.0, 1100.0)})
    densities = set()
    for seed in (0, 1, None):
        env.reset(seed=seed)
        text = bytes(env.model.plugin_attr).split(b"\0")
        densities.add(text[0])
        assert 900.0 <= float(text[0]) <= 1100.0
    assert len(densities) == 3
    env.reset(options={"water": Water(density=1000.0, buoyancy=True)})
    assert float(bytes(env.model.plugin_attr).split(b"\0")[0]) == 1000.0


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("Wade", {"sea": {"hs": 1.0}}, "options has no 'sea': use water"),
        ("Float", {"sea": {"hs": 1.0}}, "says too little"),
        ("Float", {"sea": {"hs": 1.0, "wind": 3.0}}, "sea has no 'wind'"),
        ("Float", {"sea": {"hs": -1.0, "tp": 3.0}}, "sea hs is -1.0"),
        ("Float", {"sea": "hs=1 wind=3"}, "has 'wind'"),
        ("Float", {"water": {"salt": 1}}, "water has no 'salt'"),
        ("Float", {"water": {"density": "thick"}}, "water density is 'thick'"),
        ("Float", {"water": {"density": (1100, 900)}}, "the lower end first"),
        ("Float", {"water": {"law": "newton"}}, "law is 'newton'"),
        ("Float", {"water": 1000.0}, "give a mjskip.Water or its fields"),
        ("ThrowStone", {"stone": {"radius": 3.0}}, "stone radius is 3.0: .* between 0.005 and 0.5 m"),
        ("ThrowStone", {"stone": {"radius": (0.01, 0.02, 0.03)}}, "a range \\(low, high\\)"),
        ("ThrowStone", [1], "options is \\[1\\]: give a mapping"),
    ],
)  # fmt: skip
def test_an_option_that_cannot_be_used_is_named(name, options, says):
    env = make(name)
    with pytest.raises(ValueError, match=says):
        env.reset(options=options)


@pytest.mark.parametrize("action", [[0.0, 0.0], [0.0, np.nan, 0.0], None, "ahead"])
def test_an_action_that_is_none_is_refused(action):
    env = make("Float")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="action"):
        env.step(action)


def test_steps_before_a_reset_are_refused():
    with pytest.raises(gymnasium.error.ResetNeeded):
        make("Float").step(np.zeros(3))
    with pytest.raises(gymnasium.error.ResetNeeded):
        many("Float", 2).step(np.zeros((2, 3)))


@pytest.mark.parametrize("vector", [False, True])
def test_an_episode_whose_simulation_diverges_is_over(vector, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log
    if vector:
        env = many("Float", 2)
        env.reset(seed=0)
        env._episodes.simulation.qvel[1, 0] = 1e12
        over = env.step(np.zeros((2, 3)))[2]
        assert over.tolist() == [False, True]
    else:
        env = make("Float")
        env.reset(seed=0)
        env.data.qvel[0] = 1e12
        assert env.step(np.zeros(3))[2]


def test_a_picture_shows_the_water_and_what_is_in_it():
    env = make("Float", render_mode="rgb_array", width=160, height=120)
    env.reset(seed=0)
    image = env.render()
    assert image.shape == (120, 160, 3)
    assert image.dtype == np.uint8
    red, _, blue = np.moveaxis(image[60:].astype(int), -1, 0)
    assert np.mean(blue > red + 20) > 0.5  # over a bottom that is brown
    env.close()
    assert env.render().shape == (120, 160, 3)  # and opens again
    env.close()


def test_a_camera_that_is_none_is_refused():
    env = make("Float", render_mode="rgb_array", camera="moon")
    env.reset(seed=0)
    with pytest.raises(
        ValueError, match="camera is 'moon': use one of shore, or the name of a body"
    ):
        env.render()


def test_a_throw_can_be_filmed():
    env = gymnasium.make(
        "mjskip/ThrowStone-v0", render_mode="rgb_array_list", frame_skip=200, width=64, height=48
    )
    env.reset(seed=0)
    *_, info = env.step(np.zeros(5))
    frames = env.render()
    assert len(frames) == 1 + round(info["time"] / 0.1)
    assert not np.array_equal(frames[0], frames[-1])
    assert env.render() == []
    env.close()


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("Xvfb") is None and not REQUIRED, reason="no Xvfb here (Debian: apt install xvfb)"
)
def test_a_window_opens_for_people(tmp_path):
    from test_view import display, pixels

    code = (
        "import gymnasium, mjskip.envs, time, numpy as np\n"
        "e = gymnasium.make('mjskip/Float-v0', render_mode='human'); e.reset(seed=0)\n"
        "for _ in range(60): e.step(np.zeros(3))\n"
        "print('ready', flush=True); time.sleep(1); input(); e.close()"
    )
    with display(tmp_path) as (name, file):
        environment = os.environ | {
            "DISPLAY": name,
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "MUJOCO_GL": "glfw",
        }
        with subprocess.Popen(
            [sys.executable, "-c", code], env=environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        ) as process:  # fmt: skip
            assert process.stdout.readline().strip() == "ready"
            image = pixels(file)
            process.communicate("\n", timeout=60)
    assert process.returncode == 0
    red, _, blue = np.moveaxis(image.astype(int), -1, 0)
    assert np.mean(blue > red + 20) > 0.3
