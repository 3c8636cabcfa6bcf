"""The playground in a real browser: Debian's Chromium, headless, with WebGL in software."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from mjskip.play.settings import Settings

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
REQUIRED = os.environ.get("MJSKIP_REQUIRE_BROWSER")
if not REQUIRED:
    pytest.importorskip("viser", reason="the extra play is not installed")
    pytest.importorskip("playwright", reason="playwright is not installed (extra test)")
    if CHROMIUM is None:
        pytest.skip(
            "no chromium here (Debian: apt install chromium); MJSKIP_REQUIRE_BROWSER=1 makes this fail",
            allow_module_level=True,
        )

from playwright.sync_api import expect, sync_playwright  # noqa: E402

from mjskip.play.server import Playground  # noqa: E402

PATIENCE = (
    240e3  # [ms]: a browser that draws in software on a busy machine; only a hang takes longer
)
ARTIFACTS = Path(os.environ.get("CI_ARTIFACTS") or Path(__file__).parents[1] / "out")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
SMALL = "fixedDpr=0.5"  # viser draws half as many pixels each way

pytestmark = [
    # a page that is closed while its stone flies
    pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection"),
]


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, headless=True, args=FLAGS, timeout=PATIENCE
        )
        yield browser
        browser.close()


@pytest.fixture
def new_page(browser):
    """Open an address in a tab of its own."""
    with contextlib.ExitStack() as pages:

        def new_page(address):
            page = browser.new_page(viewport={"width": 1000, "height": 700})
            pages.callback(page.close)
            page.set_default_timeout(PATIENCE)
            page.goto(address)
            button(page, "Throw").wait_for()
            return page

        yield new_page


def button(page, name):
    return page.get_by_role("button", name=name, exact=True)


def expect_text(page, text):
    expect(page.get_by_text(text, exact=True).first).to_be_visible(timeout=PATIENCE)


def in_words(count):
    return f"{count} skip{'' if count == 1 else 's'}"


def wait_until(page, condition):
    """Let the page live until something is so on the server."""
    for _ in range(int(PATIENCE / 100)):
        if condition():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it never happened")


def choose(page, label, option):
    page.get_by_label(label).first.click()
    page.get_by_role("option", name=option, exact=True).click()


def test_a_throw_from_the_page_is_the_servers_throw_and_stays_in_its_tab(lake, new_page):
    """Opens, moves a slider, throws, counts; another tab and a link with nonsense do not disturb it."""
    with contextlib.closing(Playground(lake, port=0)) as playground:
        page = new_page(f"{playground.url}/?{SMALL}")
        (tab,) = playground.tabs.values()
        default = Settings.of_scene(lake)

        # the first slider is the speed: ten steps of 0.1 m/s
        slider = page.get_by_role("slider").first
        slider.focus()
        for _ in range(10):
            slider.press("ArrowRight")
        wait_until(page, lambda: abs(tab._controls["speed"].value - default.speed - 1.0) < 1e-6)
        asked = default.changed({"speed": default.speed + 1.0})
        assert tab.thrown is None

        choose(page, "slow motion", "10")
        button(page, "Throw").click()
        wait_until(page, lambda: tab.thrown is not None)
        first = tab.thrown
        assert first.settings == asked
        alone = playground._thrower.throw(asked)
        assert first.skips == alone.skips
        expect_text(page, in_words(alone.skips))
        rows = page.locator("table.touches tbody tr")
        expect(rows).to_have_count(len(alone.chosen.contacts), timeout=PATIENCE)
        assert page.locator(".uplot").count() == 1
        page.wait_for_url(f"**/?{asked.link()}")
        wait_until(page, lambda: tab.frames > 5)
        ARTIFACTS.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=ARTIFACTS / "playground.png")
        assert (ARTIFACTS / "playground.png").stat().st_size > 20_000

        # a link in a second tab throws at once, another throw, and the first tab keeps its own
        flat = default.changed({"speed": 4, "attack": 2, "descent": 30, "height": 0.1})
        other_page = new_page(f"{playground.url}/?{SMALL}&{flat.link()}")
        other = max(playground.tabs.items())[1]
        wait_until(other_page, lambda: other.thrown is not None)
        assert other.thrown.settings == flat
        assert other.thrown.skips != first.skips
        expect_text(other_page, in_words(other.thrown.skips))
        assert tab.thrown is first
        expect_text(page, in_words(first.skips))
        other_page.close()
        wait_until(page, lambda: len(playground.tabs) == 1)

        # a link that asks for nonsense is refused as the command line would, and throws nothing
        page.goto(f"{playground.url}/?{SMALL}&speed=-3")
        expect(page.get_by_text("speed is -3 m/s").first).to_be_visible(timeout=PATIENCE)
        assert all(one.thrown is None for one in playground.tabs.values())


@pytest.mark.slow
def test_a_page_outlives_a_server_that_is_killed_mid_throw(new_page):
    """The page says that it lost its server, finds the next one at the same place, and throws again."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-u", "-m", "mjskip", "play", "--port", str(port)]

    @contextlib.contextmanager
    def serving():
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert "Ctrl-C ends" in process.stdout.readline()
                yield process
            finally:
                process.kill()

    with serving() as server:
        page = new_page(f"http://127.0.0.1:{port}/?{SMALL}")
        choose(page, "slow motion", "100")
        button(page, "Throw").click()
        expect(page.locator("table.touches tbody tr").first).to_be_attached(timeout=PATIENCE)
        server.send_signal(signal.SIGKILL)
        server.wait(PATIENCE / 1e3)
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=PATIENCE / 1e3)
    # nothing can be pressed any more
    expect(button(page, "Throw")).to_have_css("pointer-events", "none", timeout=PATIENCE)
    lost = button(page, "Throw").get_attribute("id")
    with serving():
        # the page comes back by itself, and its address still holds the throw: it is thrown again
        expect(page.locator(f"[id='{lost}']")).to_have_count(0, timeout=PATIENCE)
        expect(button(page, "Throw")).to_have_css("pointer-events", "auto", timeout=PATIENCE)
        expect(page.locator("table.touches tbody tr").first).to_be_attached(timeout=PATIENCE)
