"""Does the playground stay sound? Pages that throw again and again, then hostile connections while one plays on.

    python scripts/soak_play.py [--minutes 30] [--tabs 6] [--hostile 200]

First `--tabs` pages throw for `--minutes`, each anew some seconds after its last throw, with other speeds: memory of the
process, pages included, after a sixth of the time and at the end. Then `--hostile` connections of several kinds (other
origins, silence, garbage, half a handshake, frames too large, floods, unknown controls, paths) while one page throws on:
its frames a second before and meanwhile, and what is left open after. Prints JSON.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import http.client
import json
import logging
import random
import socket
import sys
import threading
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import viser
from viser import _messages
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from mjskip import load_scene
from mjskip.play import access
from mjskip.play.server import Playground

PATIENCE = 60.0
NAMES: list[Any] = [f"viser-v{viser.__version__}"]


class Page:
    """A client without a browser, which reads all that it is sent."""

    def __init__(self, playground: Playground) -> None:
        before = set(playground.tabs)
        address = playground.url.replace("http", "ws")
        self.socket = connect(address, origin=playground.url, subprotocols=NAMES, max_size=None)  # type: ignore[arg-type]
        self.received = 0
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.send(
            _messages.ViewerCameraMessage(
                wxyz=(1.0, 0.0, 0.0, 0.0), position=(1.0, 1.0, 1.0), fov=1.0, near=0.1, far=100.0,
                image_height=100, image_width=100, look_at=(0.0, 0.0, 0.0),
                up_direction=(0.0, 0.0, 1.0),
            )
        )  # fmt: skip
        wait_until(lambda: bool(set(playground.tabs) - before))
        (number,) = set(playground.tabs) - before
        self.tab = playground.tabs[number]
        wait_until(lambda: hasattr(self.tab, "_player"))

    def _read(self) -> None:
        with contextlib.suppress(WebSocketException, OSError):
            while True:
                self.received += len(self.socket.recv())

    def send(self, message: Any) -> None:
        """One message."""
        self.socket.send(msgspec.msgpack.encode(message.as_serializable_dict()))

    def set(self, control: str, value: Any) -> None:
        """Move a control, or press a button."""
        uuid = self.tab._controls[control]._impl.uuid
        self.send(_messages.GuiUpdateMessage(uuid=uuid, updates={"value": value}))

    def close(self) -> None:
        """Leave."""
        self.socket.close()
        self._reader.join(PATIENCE)


def wait_until(condition: Any, patience: float = PATIENCE) -> bool:
    """Whether it came true in time."""
    deadline = time.monotonic() + patience
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def memory() -> float:
    """Of this process [MB]."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def throw_on(playground: Playground, seconds: float, tabs: int, seed: int = 0) -> dict[str, Any]:
    """Pages that throw; throws, frames and memory."""
    generator = random.Random(seed)
    pages = [Page(playground) for _ in range(tabs)]
    begun = time.monotonic()
    due = [begun] * tabs
    throws, sizes, frames = 0, [], 0
    last = [page.tab.frames for page in pages]
    try:
        while (now := time.monotonic()) < begun + seconds:
            for number, page in enumerate(pages):
                frames += max(0, page.tab.frames - last[number])
                last[number] = page.tab.frames
                if now >= due[number]:
                    page.set("speed", round(generator.uniform(6.0, 16.0), 1))
                    page.set("Throw", True)
                    throws += 1
                    due[number] = now + generator.uniform(3.0, 6.0)
            sizes.append((now - begun, memory()))
            time.sleep(0.25)
    finally:
        received = sum(page.received for page in pages)
        for page in pages:
            page.close()
    gone = wait_until(lambda: not playground.tabs)
    early = [size for when, size in sizes if when <= seconds / 6.0]
    settled, final = early[-1], max(size for _, size in sizes[-8:])
    return {
        "seconds": seconds, "tabs": tabs, "throws": throws, "frames": frames,
        "received_mb": round(received / 1e6, 1), "memory_mb_after_a_sixth": round(settled, 1),
        "memory_mb_at_the_end": round(final, 1), "growth": round(final / settled - 1.0, 4),
        "all_tabs_gone": gone,
    }  # fmt: skip


# Hostile connections -----------------------------------------------------------------------------


@contextlib.contextmanager
def plain(playground: Playground) -> Iterator[socket.socket]:
    """A bare connection."""
    with socket.create_connection(("127.0.0.1", playground.port), timeout=PATIENCE) as bare:
        yield bare


def opened(playground: Playground, **options: Any) -> Any:
    """A connection that shakes hands as a page does."""
    options = {"origin": playground.url, "subprotocols": NAMES, "max_size": None, **options}
    return connect(playground.url.replace("http", "ws"), **options)


def other_origin(playground: Playground, generator: random.Random) -> None:
    """A page of another origin."""
    with opened(playground, origin="http://evil.example"):
        pass


def garbage(playground: Playground, generator: random.Random) -> None:
    """Bytes that are no request."""
    with plain(playground) as bare:
        bare.sendall(generator.randbytes(4000))
        bare.recv(1000)


def half_a_handshake(playground: Playground, generator: random.Random) -> None:
    """A request that breaks off."""
    with plain(playground) as bare:
        bare.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n")
        time.sleep(0.2)


def large_frame(playground: Playground, generator: random.Random) -> None:
    """A frame of 40 MB."""
    with opened(playground) as page:
        page.send(bytes(40_000_000))
        while True:
            page.recv(PATIENCE)


def flood(playground: Playground, generator: random.Random) -> None:
    """Messages without pause."""
    with opened(playground) as page:
        for _ in range(5000):
            page.send(
                msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {}})
            )


def no_messages(playground: Playground, generator: random.Random) -> None:
    """Frames that hold no message."""
    with opened(playground) as page:
        for _ in range(20):
            page.send(generator.randbytes(200))
        page.send("text")
        while True:
            page.recv(PATIENCE)


def odd_messages(playground: Playground, generator: random.Random) -> None:
    """Messages of unknown kinds and with unfit values."""
    values = [None, -1, "x", [], {}, 1e300, [[[]]], True]
    kinds = ["GuiUpdateMessage", "ViewerCameraMessage", "SceneNodeClickMessage", "NoSuchMessage"]
    with opened(playground) as page:
        for _ in range(20):
            page.send(
                msgspec.msgpack.encode(
                    {
                        "type": generator.choice(kinds),
                        "uuid": generator.choice(values),
                        "updates": {"value": generator.choice(values)},
                    }
                )
            )
        time.sleep(0.1)


def silence(playground: Playground, generator: random.Random) -> None:
    """A page that says nothing."""
    with opened(playground) as page:
        while True:
            page.recv(PATIENCE)


def paths(playground: Playground, generator: random.Random) -> None:
    """Files outside the page."""
    up = generator.choice(["../", "%2e%2e/", "..\\", "....//"]) * generator.randint(1, 8)
    page = http.client.HTTPConnection("127.0.0.1", playground.port, timeout=PATIENCE)
    page.request("GET", f"/{up}etc/passwd")
    if b"root:" in page.getresponse().read():
        raise AssertionError("a file of the machine was given away")
    page.close()


HOSTILE = (
    other_origin, garbage, half_a_handshake, large_frame, flood, no_messages, odd_messages, silence, paths,
)  # fmt: skip


def attack(
    playground: Playground, count: int, *, seed: int = 0, peace: float = 10.0
) -> dict[str, Any]:
    """Hostile connections, eight at a time, while one page throws on."""
    page = Page(playground)
    page.set("Throw", True)
    wait_until(lambda: page.tab.frames > 1)

    def play(over: Any) -> float:
        """Frames a second while a throw is shown again and again."""
        frames, begun, last = 0, time.monotonic(), page.tab.frames
        throw = begun
        while not over():
            frames += max(0, page.tab.frames - last)
            last = page.tab.frames
            if time.monotonic() >= throw:
                page.set("Throw", True)
                throw = time.monotonic() + 3.0
            time.sleep(0.05)
        return frames / (time.monotonic() - begun)

    until = time.monotonic() + peace
    before = play(lambda: time.monotonic() > until)
    outcomes: Counter[str] = Counter()
    serious: list[str] = []
    numbers = iter(range(count))
    lock = threading.Lock()

    def be_hostile() -> None:
        while True:
            with lock:
                number = next(numbers, None)
            if number is None:
                return
            kind = HOSTILE[number % len(HOSTILE)]
            try:
                kind(playground, random.Random(f"{seed} {number}"))
                outcome = "ended by the stranger"
            except AssertionError as error:
                serious.append(str(error))
                outcome = "serious"
            except (WebSocketException, OSError, EOFError, http.client.HTTPException) as error:
                outcome = type(error).__name__
            outcomes[f"{kind.__name__}: {outcome}"] += 1

    begun = time.monotonic()
    strangers = [threading.Thread(target=be_hostile) for _ in range(8)]
    for stranger in strangers:
        stranger.start()
    meanwhile = play(lambda: not any(stranger.is_alive() for stranger in strangers))
    took = time.monotonic() - begun
    only_one = wait_until(
        lambda: len(playground.tabs) == 1 and page.tab in playground.tabs.values()
    )
    thrown = page.tab.thrown
    page.set("Throw", True)
    plays_on = wait_until(lambda: page.tab.thrown is not thrown)
    page.close()
    return {
        "hostile": count, "seconds": round(took, 1), "frames_a_second_before": round(before, 1),
        "frames_a_second_meanwhile": round(meanwhile, 1), "plays_on": plays_on, "others_gone": only_one,
        "serious": serious, "outcomes": dict(sorted(outcomes.items())),
        "all_tabs_gone": wait_until(lambda: not playground.tabs),
    }  # fmt: skip


class _Tracebacks(logging.Handler):
    """Counts errors that libraries log."""

    found: list[str]

    def emit(self, record: logging.LogRecord) -> None:
        """One more, if it is one of ours."""
        if record.levelno >= logging.ERROR and "handshake" not in record.getMessage():
            self.found.append(record.getMessage())


@contextlib.contextmanager
def watched() -> Iterator[list[str]]:
    """Errors that threads end with, and that are logged."""
    found: list[str] = []
    handler = _Tracebacks()
    handler.found = found
    before = threading.excepthook
    threading.excepthook = lambda of: found.append(repr(of.exc_value))
    logging.getLogger().addHandler(handler)
    try:
        yield found
    finally:
        logging.getLogger().removeHandler(handler)
        threading.excepthook = before


def main() -> int:
    """Print what happened."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--tabs", type=int, default=6)
    parser.add_argument("--hostile", type=int, default=200)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    access.FIRST_MESSAGE = 5.0  # silence is dropped sooner, so that it does not take all the time
    with (
        watched() as errors,
        contextlib.closing(Playground(load_scene("lake"), port=0)) as playground,
    ):
        found: dict[str, Any] = {}
        if options.minutes:
            found["throwing"] = throw_on(playground, 60.0 * options.minutes, options.tabs)
        if options.hostile:
            found["hostile"] = attack(playground, options.hostile)
    found["errors"] = dict(Counter(errors))
    print(json.dumps(found, indent=1))
    growth = found.get("throwing", {}).get("growth", 0.0)
    hostile = found.get("hostile", {})
    return int(growth > 0.1 or bool(hostile.get("serious")) or not hostile.get("plays_on", True))


if __name__ == "__main__":
    sys.exit(main())
