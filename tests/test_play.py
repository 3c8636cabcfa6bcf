"""The playground without a browser: what its page may ask for, what it throws, and how it is shown."""

import contextlib
import gc
import http.client
import json
import math
import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mjskip import Stone, Throw
from mjskip.cli import main
from mjskip.errors import MjskipError, SceneError
from mjskip.play.player import FPS, RINGS_AFTER, PlaybackClock, Player, Replay, surface_frames
from mjskip.play.settings import Settings
from mjskip.play.surface import EVEN_VERTICES, HORIZON, SHAPE, DrawnWater, axis
from mjskip.play.thrown import Thrower, table, turned
from mjskip.throws.scene import load_scene
from mjskip.throws.trajectory import pose_at
from mjskip.waves import HeightField

PATIENCE = 120.0  # [s]: only a hang takes longer, even where other work fills the machine


@pytest.fixture(scope="module")
def shelf(lake):
    with contextlib.closing(Thrower(lake)) as shelf:
        yield shelf


@pytest.fixture(scope="module")
def default(lake):
    return Settings.of_scene(lake)


@pytest.fixture(scope="module")
def thrown(shelf, default):
    return shelf.throw(default)


# What may be asked for ----------------------------------------------------------------------------


def test_the_page_opens_with_the_throw_of_the_scene(lake, default):
    assert default.throw.speed == lake.throw.speed
    # four decimals of a degree are shown: half of the last is 1e-6 rad at most
    for name in ("attack", "descent", "bank"):
        assert getattr(default.throw, name) == pytest.approx(getattr(lake.throw, name), abs=1e-6)


def test_a_link_brings_back_the_throw_to_the_last_bit(default):
    asked = default.changed(
        {"speed": 9.5, "spin": -20, "attack": 17.25, "height": 0.05, "stone": "lens",
         "radius": 3.3, "thickness": 1.1, "law": "bocquet2003", "surface": "waves"}
    )  # fmt: skip
    assert default.read_link("?" + asked.link()) == asked
    assert asked != default


def test_an_empty_link_asks_for_nothing(default):
    assert default.read_link("") == default


BAD = {
    "nan": ("speed=nan", "speed is nan"),
    "endless": ("spin=inf", "spin is inf"),
    "negative": ("speed=-3", "speed is -3 m/s: give a number between 0 and 1000"),
    "absurd": ("spin=1e9", "spin is 1e.09 rev/s"),
    "word": ("attack=steep", "attack is 'steep': give a number"),
    "empty": ("attack=", "attack is ''"),
    "tilt": ("attack=95", "attack is 95 degrees"),
    "tilts": ("attack=60&bank=60", "cannot both hold"),
    "law": ("law=hooke", "law is 'hooke': use one of lee2010"),
    "stone": ("stone=brick", "stone is 'brick': use one of scene, pebble"),
    "surface": ("surface=lava", "surface is 'lava'"),
    "huge": ("stone=disc&radius=1e6", "radius is 1e.06 cm"),
    "thin": ("stone=disc&thickness=0", "thickness is 0 cm"),
    "ball": ("stone=lens&radius=2&thickness=5", "a lens is thinner"),
    "unknown": ("speeed=3", "'speeed' is no setting"),
    "inner": ("__class__=3", "is no setting"),
    "long": ("speed=" + "1" * 5000, "longer than"),
}


@pytest.mark.parametrize(("link", "says"), BAD.values(), ids=BAD.keys())
def test_nonsense_from_the_page_is_refused_in_one_line(default, link, says):
    with pytest.raises(ValueError, match=says) as refusal:
        default.read_link(link)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("value", [None, [1], {"a": 1}, "12m"])
def test_what_is_no_number_is_no_speed(default, value):
    with pytest.raises(ValueError, match=r"speed is .*: give a number"):
        default.changed({"speed": value})


# What is thrown -----------------------------------------------------------------------------------


def test_the_command_beside_a_throw_makes_the_same_throw(shelf, default, capsys):
    asked = default.changed({"speed": 10.3, "spin": 22.5, "attack": 18, "descent": 9, "bank": -4})
    made = shelf.throw(asked)
    program, *arguments = shlex.split(made.command)
    assert program == "mjskip"
    with pytest.raises(SystemExit):
        main([*arguments, "--json"])
    printed = json.loads(capsys.readouterr().out)
    assert printed["skips"] == made.skips
    assert printed["contacts"] == [c.summary() for c in made.chosen.contacts]  # to the last bit


def test_the_command_of_a_made_stone_reads_the_file_to_download(
    shelf, default, capsys, tmp_path, monkeypatch
):
    asked = default.changed({"stone": "disc", "radius": 4, "thickness": 1, "law": "rosellini2005"})
    made = shelf.throw(asked)
    name, text = shelf.model_file(asked)
    (tmp_path / name).write_bytes(text)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        main([*shlex.split(made.command)[1:], "--json"])
    printed = json.loads(capsys.readouterr().out)
    assert printed["skips"] == made.skips
    assert printed["law"] == "rosellini2005"
    assert printed["triangles"] == 4 * 64


@pytest.mark.parametrize("kind", ["pebble", "disc", "lens"])
def test_a_made_stone_is_the_stone_of_that_size(shelf, default, kind):
    asked = default.changed({"stone": kind, "radius": 5, "thickness": 2})
    stone = shelf.throw(asked).scene.stone
    assert turned(asked).mass == pytest.approx(
        getattr(Stone, kind)(radius=0.05, thickness=0.02).mass
    )
    # MJCF keeps six digits of a vertex, three vertices make a volume
    assert stone.mass == pytest.approx(turned(asked).mass, rel=5e-6)
    assert stone.thickness == pytest.approx(0.02, rel=2e-6)


def test_a_heavier_stone_of_the_same_shape_goes_deeper_at_its_first_touch(shelf, default):
    depths = [
        shelf.throw(default.changed({"stone": "disc", "radius": 4, "thickness": t}))
        .chosen.contacts[0]
        .depth
        for t in (0.8, 2.4)
    ]
    assert depths[1] > depths[0]


def test_the_thrower_of_stones_does_not_grow_without_end(lake, default, monkeypatch):
    monkeypatch.setattr("mjskip.play.thrown.MAX_STONES", 2)
    with contextlib.closing(Thrower(lake)) as shelf:
        for radius in (3, 4, 5, 6):
            shelf.model_file(default.changed({"stone": "pebble", "radius": radius}))
        assert len(shelf._made) == 2
        folder = shelf._folder.name
        assert len(os.listdir(folder)) == 2
    assert not os.path.exists(folder)


def test_a_throw_too_fast_for_its_time_step_is_doubted_on_the_page(shelf, default):
    (warning,) = shelf.throw(default.changed({"speed": 60})).warnings
    assert "too large" in warning


def test_an_arms_throw_is_not_the_pages_to_choose():
    with pytest.raises(SceneError, match="thrown by the arm"):
        Thrower(load_scene("thrower"))


def test_throws_from_many_tabs_at_once_are_those_made_alone(shelf, default):
    asked = [default.changed({"speed": speed}) for speed in (8, 10, 12, 14)] * 2
    alone = [shelf.throw(one).skips for one in asked]
    found = [None] * len(asked)

    def throw(k):
        found[k] = shelf.throw(asked[k]).skips

    threads = [threading.Thread(target=throw, args=(k,)) for k in range(len(asked))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert found == alone


def test_the_table_has_a_row_for_every_touch(thrown):
    head, *rows = table(thrown.chosen)
    assert len(rows) == len(thrown.chosen.contacts)
    assert {len(row) for row in rows} == {len(head)}


# What is drawn ------------------------------------------------------------------------------------


def test_the_drawn_water_reaches_the_horizon_evenly_near_the_stone():
    for count, even in zip(SHAPE, EVEN_VERTICES, strict=True):
        at = axis(count, even, 0.04)
        assert len(at) == count
        assert at[-1] == pytest.approx(HORIZON)
        np.testing.assert_allclose(at, -at[::-1])
        first = (count - even) // 2
        np.testing.assert_allclose(np.diff(at)[first : first + even - 1], 0.04)
        assert (np.diff(at) > 0.0399).all()


def test_the_faces_of_the_drawn_water_look_up():
    water = DrawnWater()
    corners = water.vertices(None, middle=(0, 0))[water.faces]
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (up[:, 2] > 0).all()


def test_the_drawn_heights_are_those_of_the_lake():
    lake, water = HeightField.endless(), DrawnWater()
    lake.press(1.0, 0.3, force=300.0, radius=0.4)
    lake.advance(0.02)
    lake.advance(0.6)
    middle = water.place(1.03, 0.29)
    vertices = water.vertices(lake, middle=middle)
    near = (np.abs(vertices[:, 0]) < 2.0) & (np.abs(vertices[:, 1]) < 1.4)

    def wrong_by(aside):
        at = vertices[near, :2] + middle + (aside, 0.0)
        return vertices[near, 2] - lake.sample(at[:, 0], at[:, 1]).elevation

    highest = np.abs(vertices[:, 2]).max()
    assert highest > 1e-3
    # a vertex shows the mean over its 4 cm, which rounds off the sharp middle of the rings
    assert np.abs(wrong_by(0.0)).max() < 0.1 * highest
    # and it does so in the right place: half a cell of the lake aside fits far worse
    for aside in (-0.01, 0.01):
        assert 3.0 * np.std(wrong_by(0.0)) < np.std(wrong_by(aside))
    assert vertices[-1, 2] == 0.0  # still at the horizon


def test_a_vertex_keeps_its_place_in_the_world_as_the_grid_follows_the_stone():
    water = DrawnWater()
    for x in np.linspace(0.0, 0.3, 13):
        place = water.place(float(x), 0.0)[0]
        assert place / water.step == pytest.approx(round(place / water.step), abs=1e-9)
        assert abs(place - x) <= 0.5 * water.step + 1e-12


# How it is shown ----------------------------------------------------------------------------------


class Clock:
    """A clock that a test moves."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def test_slow_motion_changes_underway_without_a_jump():
    clock = Clock()
    pace = PlaybackClock(clock)
    clock.now += 2.0
    assert pace.time == pytest.approx(2.0)
    pace.slow(10.0)
    assert pace.time == pytest.approx(2.0)
    clock.now += 5.0
    assert pace.time == pytest.approx(2.5)


def test_a_show_has_the_water_that_was_recorded_with_the_run(shelf, default):
    thrown = shelf.throw(default, record=surface_frames())
    replay, surface = Replay(thrown), thrown.chosen.surface
    assert surface.times[-1] >= replay.end - 1.0 / FPS
    for moment in surface.times[::20]:
        np.testing.assert_array_equal(
            replay.at(moment).water.elevation, surface.at(moment).elevation
        )
    frame = replay.at(1e9)
    assert frame.last
    assert frame.time == pytest.approx(thrown.chosen.time[-1] + RINGS_AFTER)
    assert frame.touches == len(thrown.chosen.contacts)


def test_a_frame_shows_the_stone_where_it_was(thrown):
    flight = thrown.chosen
    position, attitude = pose_at(flight, 0.2)
    row = int(np.searchsorted(flight.time, 0.2, side="right")) - 1
    np.testing.assert_array_equal(position, flight.position[row])
    assert Rotation.from_quat(attitude, scalar_first=True).as_matrix()[2, 2] > 0.5
    assert (pose_at(flight, 1e9)[0] == flight.position[-1]).all()


class Stage:
    """Takes frames, and lets a test wait for one."""

    def __init__(self, **options):
        self.frames, self.failures = [], []
        self._changed = threading.Condition()
        self.player = Player(self.draw, failed=self.failures.append, **options)

    def draw(self, frame):
        with self._changed:
            self.frames.append(frame)
            self._changed.notify_all()

    def wait(self, condition):
        with self._changed:
            assert self._changed.wait_for(condition, timeout=PATIENCE), self.failures

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.player.close()
        assert not self.player._thread.is_alive()


def test_a_throw_is_shown_at_the_pace_of_the_clock(thrown):
    with Stage() as stage:
        begun = time.perf_counter()
        stage.player.play(thrown)
        stage.wait(lambda: stage.frames and stage.frames[-1].last)
        took = time.perf_counter() - begun
    times = [frame.time for frame in stage.frames]
    assert times == sorted(times)
    # never ahead of the clock, and behind it only by the last frame
    assert times[-1] <= took
    assert took - times[-1] <= 1.0
    assert not stage.failures


def test_a_machine_that_cannot_keep_up_drops_frames_and_stays_with_the_clock(thrown):
    clock = Clock()
    with Stage(clock=clock, fps=1e6) as stage:
        draw = stage.draw

        def slowly(frame):  # a second goes by with every frame
            clock.now += 1.0
            draw(frame)

        stage.player._draw = slowly
        stage.player.play(thrown)
        stage.wait(lambda: stage.frames and stage.frames[-1].last)
    times = [frame.time for frame in stage.frames]
    assert len(times) <= math.ceil(times[-1]) + 1
    np.testing.assert_allclose(np.diff(times)[:-1], 1.0, atol=1e-9)


def test_a_new_throw_takes_the_place_of_the_one_that_is_shown(shelf, default, thrown):
    other = shelf.throw(default.changed({"speed": 8}))
    with Stage() as stage:
        stage.player.play(thrown)
        stage.wait(lambda: len(stage.frames) > 2)
        stage.player.play(other)
        stage.wait(lambda: stage.frames[-1].thrown is other and stage.frames[-1].time > 0.1)
        first = next(frame for frame in stage.frames if frame.thrown is other)
        assert first.time < 0.1
        stage.player.halt()
        count = len(stage.frames)
        assert not stage.player.playing
        time.sleep(0.2)
        assert len(stage.frames) == count


def test_slow_motion_reaches_a_show_that_runs(thrown):
    with Stage() as stage:
        stage.player.slow(1000.0)
        stage.player.play(thrown)
        stage.wait(lambda: len(stage.frames) > 3)
        assert stage.frames[-1].time < 0.1
        stage.player.slow(1.0)
        stage.wait(lambda: stage.frames[-1].time > 0.5)


def test_a_page_that_cannot_be_drawn_ends_its_show_and_no_other(thrown):
    def broken(frame):
        raise RuntimeError("gone")

    with Stage() as stage:
        draw, stage.player._draw = stage.player._draw, broken
        stage.player.play(thrown)
        deadline = time.monotonic() + PATIENCE
        while not stage.failures and time.monotonic() < deadline:
            time.sleep(0.01)
        assert [str(error) for error in stage.failures] == ["gone"]
        stage.player._draw = draw
        stage.player.play(thrown)
        stage.wait(lambda: stage.frames)


def test_a_throw_over_its_own_waves_can_be_shown(shelf, default):
    made = shelf.throw(default.changed({"surface": "waves"}))
    assert made.chosen.attributes["surface"] == "waves"
    frame = Replay(made).at(made.chosen.contacts[0].entry.time + 0.1)
    assert frame.water.highest > 1e-3


def test_the_water_that_is_drawn_keeps_up_with_the_clock_three_times_over(thrown):
    replay, water = Replay(thrown), DrawnWater()
    begun = time.process_time()
    now = 0.0
    while not (frame := replay.at(now)).last:
        now += 1 / 30
        x, y, _ = frame.poses[thrown.scene.body][0]
        water.vertices(frame.water, middle=water.place(float(x), float(y)))
    # processor time, which other work on the machine does not lengthen much
    assert time.process_time() - begun < frame.time / 3.0


# Serving ------------------------------------------------------------------------------------------

viser = pytest.importorskip("viser", reason="the extra play is not installed")

from mjskip.play import access as play_access  # noqa: E402
from mjskip.play.access import is_loopback, may_talk  # noqa: E402
from mjskip.play.server import Playground, check_free  # noqa: E402


@contextlib.contextmanager
def listener(host="127.0.0.1"):
    with socket.socket() as taken:
        taken.bind((host, 0))
        taken.listen()
        yield taken.getsockname()[1]


def test_a_port_in_use_is_one_clear_line_and_code_2(capsys):
    with listener() as port, pytest.raises(SystemExit) as ended:
        main(["play", "--port", str(port)])
    assert ended.value.code == 2
    (line,) = [x for x in capsys.readouterr().err.splitlines() if x.startswith("mjskip: ")]
    assert f"port {port} of 127.0.0.1 is in use" in line
    assert "--port" in line


REFUSED = {
    "foreign address": ("203.0.113.1", "cannot listen at 203.0.113.1.*127.0.0.1"),
    "unknown name": ("no.such.host.invalid", "host 'no.such.host.invalid' is unknown"),
}


@pytest.mark.parametrize(("host", "says"), REFUSED.values(), ids=REFUSED.keys())
def test_nobody_listens_at_an_address_that_is_not_this_machines(host, says):
    with pytest.raises(MjskipError, match=says):
        check_free(host, 8080)


def test_a_free_port_is_left_free():
    with listener() as port:
        pass
    check_free("127.0.0.1", port)
    check_free("127.0.0.1", port)


TALK = {
    "the page": ("http://127.0.0.1:8080", "127.0.0.1:8080", "127.0.0.1", True),
    "by name": ("http://localhost:8080", "localhost:8080", "127.0.0.1", True),
    "a program": (None, "127.0.0.1:8080", "127.0.0.1", True),
    "another page": ("http://evil.example", "127.0.0.1:8080", "127.0.0.1", False),
    "another port": ("http://127.0.0.1:9090", "127.0.0.1:8080", "127.0.0.1", False),
    "rebound name": ("http://evil.example:8080", "evil.example:8080", "127.0.0.1", False),
    "no page": ("null", "127.0.0.1:8080", "127.0.0.1", False),
    "in the network": ("http://192.0.2.7:8080", "192.0.2.7:8080", "0.0.0.0", True),
    "another, network": ("http://evil.example", "192.0.2.7:8080", "0.0.0.0", False),
}


@pytest.mark.parametrize(("origin", "host", "bound", "may"), TALK.values(), ids=TALK.keys())
def test_pages_from_elsewhere_may_not_use_the_playground(origin, host, bound, may):
    assert may_talk(origin, host, bound=bound) is may


def test_which_addresses_are_this_machine_only():
    assert all(map(is_loopback, ("127.0.0.1", "127.0.0.9", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "192.0.2.7", "::", "example.org", "")))


@pytest.fixture(scope="module")
def playground(lake):
    with contextlib.closing(Playground(lake, port=0)) as playground:
        yield playground


def test_the_page_is_served_on_this_machine_only_unless_told_otherwise(playground):
    assert playground.url.startswith("http://127.0.0.1:")
    connection = http.client.HTTPConnection("127.0.0.1", playground.port, timeout=PATIENCE)
    connection.request("GET", "/?speed=12")
    answer = connection.getresponse()
    assert answer.status == 200
    assert b"<html" in answer.read()
    connection.close()
    (own,) = {
        line.split()[1]
        for line in Path("/proc/net/tcp").read_text().splitlines()[1:]
        if line.split()[1].endswith(f":{playground.port:04X}") and line.split()[3] == "0A"
    }
    assert own.startswith("0100007F")  # 127.0.0.1, as the kernel writes it


def test_no_page_can_make_the_playground_public(playground):
    assert playground._server.request_share_url() is None


def test_the_default_throw_skips_on_the_page_as_at_the_command_line(playground, default):
    assert playground._thrower.throw(default).skips >= 2


@contextlib.contextmanager
def served(*options):
    """`mjskip play` as a process, and its address."""
    command = [sys.executable, "-u", "-m", "mjskip", "play", "--port", "0", *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            line = process.stdout.readline()
            assert "Ctrl-C ends" in line, process.stderr.read()
            yield process, line
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "terminate"])
def test_ctrl_c_ends_it_cleanly(number):
    with served() as (process, line):
        assert "http://127.0.0.1:" in line
        assert "this machine only" in line
        process.send_signal(number)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert out == "mjskip play: ended\n"
    assert err == ""


def test_listening_to_everybody_is_said():
    with served("--host", "0.0.0.0") as (process, line):
        assert "?token=" in line
        assert "nothing is encrypted" in line
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)


def test_throw_of_the_page_in_radians():
    asked = Settings(speed=3, spin=1, attack=90, descent=0, bank=0, height=0)
    assert asked.throw == Throw(
        speed=3.0, spin=2 * math.pi, attack=math.pi / 2, descent=0.0, bank=0.0, height=0.0
    )


# The page as a program would talk to it -----------------------------------------------------------


class Page:
    """A client of the playground without a browser: it only sends."""

    def __init__(self, playground, *, origin=None):
        import msgspec
        from viser import _messages
        from websockets.sync.client import connect

        self._encode = msgspec.msgpack.encode
        before = set(playground.tabs)
        origin = origin or playground.url
        self.socket = connect(
            playground.url.replace("http", "ws"),
            origin=origin,
            subprotocols=[f"viser-v{viser.__version__}"],
            max_size=None,
        )
        self.send(
            _messages.ViewerCameraMessage(
                wxyz=(1.0, 0.0, 0.0, 0.0),
                position=(1.0, 1.0, 1.0),
                fov=1.0,
                near=0.1,
                far=100.0,
                image_height=100,
                image_width=100,
                look_at=(0.0, 0.0, 0.0),
                up_direction=(0.0, 0.0, 1.0),
            )
        )
        self.tab = None
        if origin == playground.url:
            wait_until(lambda: set(playground.tabs) - before)
            (number,) = set(playground.tabs) - before
            self.tab = playground.tabs[number]
            wait_until(lambda: hasattr(self.tab, "_player"))

    def send(self, message):
        self.socket.send(self._encode(message.as_serializable_dict()))

    def set(self, control, value):
        from viser import _messages

        uuid = self.tab._controls[control]._impl.uuid
        self.send(_messages.GuiUpdateMessage(uuid=uuid, updates={"value": value}))

    def listen(self):
        """Until the connection ends."""
        while True:
            self.socket.recv(timeout=PATIENCE)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never happened"
        time.sleep(0.01)


# what is still on its way to a page that has gone is lost, and viser says so
gone = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


@gone
def test_a_page_of_another_origin_is_turned_away(playground):
    from websockets.exceptions import InvalidStatus

    with pytest.raises(InvalidStatus) as refused:
        Page(playground, origin="http://evil.example")
    assert refused.value.response.status_code == 403
    assert not playground.tabs


def connection_closed(page):
    from websockets.exceptions import ConnectionClosed

    with pytest.raises(ConnectionClosed) as closed:
        page.listen()
    return closed.value.rcvd.code


@gone
def test_a_frame_that_no_control_sends_ends_its_connection(playground):
    with Page(playground) as page:
        page.socket.send(b"x" * (play_access.LARGEST_FRAME + 1))
        assert connection_closed(page) == 1009
    wait_until(lambda: not playground.tabs)


@gone
def test_a_page_that_sends_without_pause_is_closed_and_others_play_on(playground, monkeypatch):
    from websockets.exceptions import ConnectionClosed

    with Page(playground) as quiet:
        quiet.set("Throw", True)
        monkeypatch.setattr(play_access, "MAX_MESSAGES", 50)
        with Page(playground) as page:
            with contextlib.suppress(ConnectionClosed):  # it may be closed while it still sends
                for _ in range(100):
                    page.set("speed", 11.0)
            assert connection_closed(page) == 1008
        wait_until(lambda: quiet.tab.thrown is not None and quiet.tab.frames > 1)
    wait_until(lambda: not playground.tabs)


def test_a_stranger_who_says_nothing_is_dropped(playground, monkeypatch):
    from websockets.sync.client import connect

    monkeypatch.setattr(play_access, "FIRST_MESSAGE", 0.2)
    names = [f"viser-v{viser.__version__}"]
    with connect(playground.url.replace("http", "ws"), subprotocols=names, max_size=None) as socket:
        page = type("Silent", (), {"listen": lambda _: [socket.recv(PATIENCE) for _ in range(999)]})
        assert connection_closed(page()) == 1008


@gone
def test_an_unknown_choice_of_the_page_is_ignored(playground, capsys, monkeypatch):
    said = []
    with Page(playground) as page:
        monkeypatch.setattr(page.tab, "_status", said.append)
        page.set("slow", "as fast as you can")
        page.set("view", "from below")
        wait_until(lambda: {text.split(":")[0] for text in said} >= {"slow", "view"})
        page.set("slow", "10")
        wait_until(lambda: page.tab._controls["slow"].value == "10")
        wait_until(lambda: page.tab._controls["view"].value != "from below")
        page.set("Throw", True)
        wait_until(lambda: page.tab.thrown is not None)
    assert "Traceback" not in capsys.readouterr().err
    wait_until(lambda: not playground.tabs)


@gone
def test_a_message_that_cannot_be_read_is_one_line_and_the_page_plays_on(playground, capsys):
    from viser import _messages

    with Page(playground) as page:
        for uuid in ({}, [1], None, 3.0):
            page.send(_messages.GuiUpdateMessage(uuid=uuid, updates={"value": 3}))
        page.set("Throw", True)
        wait_until(lambda: page.tab.thrown is not None)
    wait_until(lambda: not playground.tabs)
    gc.collect()  # asyncio tells of a task that failed when it is thrown away
    printed = capsys.readouterr().err
    assert "Traceback" not in printed
    assert "mjskip play: a page sent what cannot be read (TypeError" in printed


def test_beyond_this_machine_the_address_needs_its_token(monkeypatch):
    access = play_access.AccessControl("0.0.0.0")
    assert len(access.token) > 20

    def refusal(path="/", **headers):
        from websockets.datastructures import Headers
        from websockets.http11 import Request

        return access.refusal(Request(path, Headers(Host="192.0.2.7:8080", **headers)))

    assert "token" in refusal()
    assert "token" in refusal("/?token=guess")
    assert "token" in refusal(Cookie="mjskip_token=guess")
    assert refusal(f"/?token={access.token}&speed=3") is None
    assert refusal(Cookie=f"mjskip_token={access.token}") is None
    assert "not from here" in refusal(f"/?token={access.token}", Origin="http://evil.example")
    assert play_access.AccessControl("127.0.0.1").token == ""


@gone
@pytest.mark.parametrize("value", [1e9, -3, math.nan, math.inf])
def test_a_forged_slider_throws_nothing_and_is_told_why(playground, value):
    with Page(playground) as page:
        page.set("speed", value)
        page.set("Throw", True)
        wait_until(lambda: "No throw" in page.tab._controls["status"].content)
        assert "between 0 and 1000 m/s" in page.tab._controls["status"].content
        assert page.tab.thrown is None
        page.set("speed", 12.0)
        page.set("Throw", True)
        wait_until(lambda: page.tab.thrown is not None)
    wait_until(lambda: not playground.tabs)


@gone
def test_a_forged_choice_is_refused(playground):
    with Page(playground) as page:
        page.set("law", "<script>alert(1)</script>")
        page.set("Throw", True)
        wait_until(lambda: "law is" in page.tab._controls["status"].content)
        assert "<script>" not in page.tab._controls["status"].content
        assert page.tab.thrown is None
    wait_until(lambda: not playground.tabs)


@gone
def test_two_tabs_do_not_mix_their_throws(playground):
    with Page(playground) as one, Page(playground) as two:
        two.set("speed", 20.0)
        one.set("Throw", True)
        two.set("Throw", True)
        wait_until(lambda: one.tab.thrown and two.tab.thrown)
        wait_until(lambda: one.tab.frames > 1 and two.tab.frames > 1)
        assert one.tab.thrown.settings.speed == 12.0
        assert two.tab.thrown.settings.speed == 20.0
        assert one.tab._nodes["water"] is not two.tab._nodes["water"]
        mine = one.tab.thrown
        two.set("Reset", True)
        wait_until(lambda: two.tab._controls["speed"].value == 12.0)
        assert one.tab.thrown is mine
        assert one.tab._player.playing
    wait_until(lambda: not playground.tabs)


@gone
def test_a_tab_that_closes_mid_throw_leaves_no_thread_behind(playground):
    with Page(playground) as page:
        page.set("Throw", True)
        wait_until(lambda: page.tab.frames > 1)
        thread = page.tab._player._thread
    wait_until(lambda: not thread.is_alive())


@gone
def test_only_so_many_tabs_are_served(playground, monkeypatch):
    monkeypatch.setattr("mjskip.play.server.MAX_TABS", 1)
    with Page(playground) as page:
        before = set(playground.tabs)
        from mjskip.play import server

        assert server.MAX_TABS == len(before) == 1
        playground._on_connect(page.tab.client)  # one more
        assert set(playground.tabs) == before
    wait_until(lambda: not playground.tabs)


@gone
def test_again_shows_the_last_throw_whatever_the_controls_say_now(playground):
    with Page(playground) as page:
        page.set("Throw", True)
        wait_until(lambda: page.tab.frames > 1)
        last = page.tab.thrown
        page.set("speed", 20.0)
        page.set("Again", True)
        frames = page.tab.frames
        wait_until(lambda: page.tab.frames > frames + 3)
        assert page.tab.thrown is last
    wait_until(lambda: not playground.tabs)


@gone
def test_the_view_of_the_whole_throw_shows_it_from_end_to_end(playground):
    from mjskip.play.look import FOLLOW, WHOLE, grid

    with Page(playground) as page:
        page.set("view", WHOLE)
        page.set("Throw", True)
        wait_until(lambda: page.tab.frames > 1)
        flight = page.tab.thrown.chosen
        middle = 0.5 * (flight.position[0] + flight.position[-1])
        np.testing.assert_allclose(page.tab._nodes["lake"].position[:2], -middle[:2])
        wide = grid(WHOLE, page.tab.thrown)
        assert wide.step * EVEN_VERTICES[0] > np.ptp(flight.position[:, 0])
        page.set("view", FOLLOW)
        wait_until(lambda: page.tab._water.step < wide.step)
        frames = page.tab.frames
        wait_until(lambda: page.tab.frames > frames + 1)
        assert page.tab._nodes["lake"].position[0] != -middle[0]
    wait_until(lambda: not playground.tabs)


def test_after_its_run_a_stone_goes_on_a_little_and_sinks(thrown):
    from mjskip.play.player import SINKING, SLOWING, pose_after

    flight = thrown.chosen
    assert flight.end == "planing"
    end, last = float(flight.time[-1]), flight.position[-1]
    np.testing.assert_array_equal(pose_after(flight, 0.5 * end)[0], pose_at(flight, 0.5 * end)[0])
    later = pose_after(flight, end + 3.0)[0]
    ahead = float(np.linalg.norm((later - last)[:2]))
    assert 0.9 < ahead / (SLOWING * np.linalg.norm(flight.velocity[-1, :2])) <= 1.0
    assert last[2] - later[2] == pytest.approx(SINKING * (3.0 - SLOWING))
