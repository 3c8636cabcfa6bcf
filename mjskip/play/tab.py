"""One browser tab: its controls, its lake, its throws. Nothing here is shared with other tabs."""

from __future__ import annotations

import html
import json
import threading
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from mjskip.errors import MjskipError
from mjskip.hydro.laws import LAWS
from mjskip.play import look
from mjskip.play.player import Frame, Player, surface_frames
from mjskip.play.settings import NUMBERS, STONES, THROW, Settings
from mjskip.play.surface import DrawnWater
from mjskip.play.thrown import Thrower, ThrowResult, table
from mjskip.throws.trajectory import ENDS

SLIDERS: dict[str, tuple[str, float, float, float, str]] = {
    "speed": ("speed (m/s)", 0.0, 40.0, 0.1, "Of the stone as it leaves the hand."),
    "spin": ("spin (rev/s)", -60.0, 60.0, 0.5, "Counter-clockwise seen from above."),
    "attack": ("attack (°)", -30.0, 80.0, 0.5, "Tilt of the face to the water, nose up."),
    "descent": ("descent (°)", -30.0, 80.0, 0.5, "Of the path below the horizontal."),
    "bank": ("bank (°)", -45.0, 45.0, 0.5, "Tilt to the side; positive leans left."),
    "height": ("height (m)", 0.0, 3.0, 0.01, "Of the lowest point above still water."),
    "radius": ("radius (cm)", 1.0, 15.0, 0.1, "Of the made stone."),
    "thickness": ("thickness (cm)", 0.2, 8.0, 0.1, "Of the made stone."),
}
"""Control: label, range, step, hint. A link may go beyond the range as far as the command line does."""

SLOW = {"1 (real time)": 1.0, "2": 2.0, "5": 5.0, "10": 10.0, "30": 30.0, "100": 100.0}
"""Choices of slow motion: how many times slower."""

KEY = "mjskip address"


class Tab:
    """The controls and the lake of one viser client.

    Attributes:
        thrown: the last throw; None before the first.
        frames: drawn so far.
    """

    def __init__(self, client: Any, thrower: Thrower) -> None:
        self.client = client
        self.thrown: ThrowResult | None = None
        self.frames = 0
        self._thrower = thrower
        self._start = Settings.of_scene(thrower.scene)
        self._busy = threading.Lock()
        self._closed = False
        self._touches = 0
        self._origin = ""
        self._water = DrawnWater()
        self._controls: dict[str, Any] = {}
        with client.atomic():
            self._nodes = look.lake(client, self._water, thrower.scene.stones)
            self._add_controls()
            self._still()
        self._player = Player(self._draw, failed=self._drawing_failed)

    # Throwing -----------------------------------------------------------------------------------

    def open_link(self) -> None:
        """Take the settings from the page's address, and throw if it has any."""
        address = urlsplit(_request_address(self.client))
        self._origin = f"{address.scheme}://{address.netloc}"
        names = "&".join(
            part for part in address.query.split("&") if part.split("=")[0] not in look.VISER
        )
        if not names:
            return
        try:
            settings = self._start.read_link(names)
        except ValueError as error:
            self._show_refusal(str(error))
            return
        self._show_settings(settings)
        self._throw(settings)

    def throw(self, _: Any = None) -> None:
        """Throw what the controls say."""
        try:
            settings = self._read_controls()
        except ValueError as error:
            self._show_refusal(str(error))
            return
        self._throw(settings)

    def again(self, _: Any = None) -> None:
        """Show the last throw once more, whatever the controls say now."""
        if self.thrown is not None:
            self._player.play(self.thrown)

    def reset(self, _: Any = None) -> None:
        """Controls as the scene has them, the stone in the hand, the water still."""
        self._player.halt()
        self._show_settings(self._start)
        with self.client.atomic():
            self._still()

    def close(self) -> None:
        """The tab is gone."""
        self._closed = True
        self._player.close()

    def _throw(self, settings: Settings) -> None:
        if not self._busy.acquire(blocking=False):  # a second press while the first is worked out
            return
        try:
            self._status("working it out …")
            thrown = self._thrower.throw(settings, record=surface_frames())
        except (MjskipError, ValueError) as error:
            self._status("")
            self._show_refusal(" ".join(str(error).split()))
            return
        finally:
            self._busy.release()
        self._player.halt()
        self.thrown = thrown
        with self.client.atomic():
            self._report(thrown)
            self._water = look.grid(self._choice("view", look.VIEWS), thrown)
            look.place_throw(self._nodes, thrown)
            self._touches = 0
        if self._choice("view", look.VIEWS) != look.FOLLOW:
            look.aim(self.client, self._choice("view", look.VIEWS), thrown)
        self._status(thrown.warnings[0] if thrown.warnings else "")
        self._player.play(thrown)

    # What is shown ------------------------------------------------------------------------------

    def _draw(self, frame: Frame) -> None:
        if self._closed:
            return
        if frame.touches != self._touches:
            look.mark_touches(self._nodes, frame)
            self._touches = frame.touches
        with self.client.atomic():
            look.draw(
                self._nodes, self._water, frame, view=self._choice("view", look.VIEWS),
                forces=bool(self._controls["forces"].value),
            )  # fmt: skip
        self.frames += 1
        self._clock(f"{frame.time:.2f} s")

    def _still(self) -> None:
        look.still(self._nodes, self._water, self._thrower.scene, self._start.throw)

    def _report(self, thrown: ThrowResult) -> None:
        flight = thrown.chosen
        skips = f"{thrown.skips} skip{'' if thrown.skips == 1 else 's'}"
        away = float(np.linalg.norm(flight.position[-1, :2] - flight.position[0, :2]))
        self._controls["count"].content = look.headline(
            skips, f"{ENDS[flight.end]}, after {away:.1f} m and {flight.time[-1]:.2f} s"
        )
        self._controls["table"].content = look.html_table(table(flight))
        self._controls["plot"].data = look.side_view(flight)
        self._controls["plot"].visible = self._controls["table"].visible = True
        link = f"{self._origin}/?{thrown.settings.link()}"
        self._controls["link"].content = (
            f"[Link to this throw]({link})\n\n```\n{link}\n```\n\nThe same throw at the command line:\n\n"
            f"```sh\n{thrown.command}\n```"
        )
        self._controls["download"].visible = thrown.settings.stone != "scene"
        _set_address(self.client, thrown.settings.link())

    def _status(self, text: str) -> None:
        self._controls["status"].content = look.small(text)

    def _clock(self, text: str) -> None:
        self._controls["clock"].content = look.small(text)

    def _show_refusal(self, text: str) -> None:
        self.client.add_notification(
            "No throw", text, color="red", with_close_button=True, auto_close_seconds=20.0
        )
        self._status(f"<b>No throw:</b> {html.escape(text)}")

    def _drawing_failed(self, error: Exception) -> None:
        if not self._closed:
            self._show_refusal(" ".join(str(error).split()) or type(error).__name__)

    # Controls -----------------------------------------------------------------------------------

    def _add_controls(self) -> None:
        gui, controls, start = self.client.gui, self._controls, self._start
        controls["count"] = gui.add_html(look.headline("Skip a stone", "set it up and press Throw"))
        self._button("Throw", self.throw, color="teal", icon="SEND")
        self._button("Again", self.again, color="gray", icon="REPEAT")
        self._button("Reset", self.reset, color="gray", icon="ARROW_BACK_UP")
        controls["status"] = gui.add_html("")
        controls["slow"] = gui.add_dropdown(
            "slow motion", tuple(SLOW), initial_value=next(iter(SLOW)), hint="Times slower."
        )
        controls["slow"].on_update(
            lambda _: self._player.slow(SLOW[self._choice("slow", tuple(SLOW))])
        )
        controls["view"] = gui.add_dropdown("view", look.VIEWS, initial_value=look.FOLLOW)
        controls["view"].on_update(self._change_view)
        controls["forces"] = gui.add_checkbox(
            "forces", False, hint="Arrows of the water (blue) and the air (white) on the stone."
        )
        controls["waves"] = gui.add_html(
            look.small(f"Waves are drawn {look.WAVE_EXAGGERATION:g} times as high as they are.")
        )
        controls["clock"] = gui.add_html("")
        with gui.add_folder("Throw it", order=None):
            for name in THROW:
                self._slider(name)
        with gui.add_folder("Stone and water"):
            controls["stone"] = gui.add_dropdown("stone", STONES, initial_value=start.stone)
            controls["stone"].on_update(lambda _: self._show_sizes())
            self._slider("radius")
            self._slider("thickness")
            controls["law"] = gui.add_dropdown("force law", tuple(LAWS), initial_value=start.law)
            controls["surface"] = gui.add_dropdown(
                "water",
                ("still", "waves"),
                initial_value=start.surface,
                hint="still: stones feel the undisturbed level; waves: what they made of it.",
            )
        with gui.add_folder("Last throw"):
            controls["table"] = gui.add_html("<p style='margin:.5em 1em'>None yet.</p>")
            controls["plot"] = look.add_plot(gui)
        with gui.add_folder("Share", expand_by_default=False):
            controls["link"] = gui.add_markdown("Throw first.")
            controls["download"] = gui.add_button("Download the scene with this stone")
            controls["download"].on_click(self._download)
            controls["download"].visible = False
        self._show_sizes()

    def _button(self, label: str, press: Callable[[Any], None], *, color: str, icon: str) -> None:
        import viser

        button = self.client.gui.add_button(label, color=color, icon=getattr(viser.Icon, icon))
        button.on_click(press)
        self._controls[label] = button

    def _slider(self, name: str) -> None:
        label, low, high, step, hint = SLIDERS[name]
        value = getattr(self._start, name)
        self._controls[name] = self.client.gui.add_slider(
            label, min(low, value), max(high, value), step, value, hint=hint
        )

    def _read_controls(self) -> Settings:
        """The settings as the page has them; whatever a page sends is checked like the command line.

        Raises:
            ValueError: nonsense.
        """
        names = (*NUMBERS, "stone", "law", "surface")
        return self._start.changed({name: self._controls[name].value for name in names})

    def _show_settings(self, settings: Settings) -> None:
        for name in NUMBERS:
            slider, value = self._controls[name], getattr(settings, name)
            slider.min, slider.max = min(slider.min, value), max(slider.max, value)
            slider.value = value
        for name in ("stone", "law", "surface"):
            self._controls[name].value = getattr(settings, name)
        self._show_sizes()

    def _show_sizes(self) -> None:
        for name in ("radius", "thickness"):
            self._controls[name].visible = self._controls["stone"].value != "scene"

    def _choice(self, name: str, allowed: tuple[str, ...]) -> str:
        """What a dropdown says; a value that it does not have is put back to the first that it has."""
        value = str(self._controls[name].value)
        if value in allowed:
            return value
        self._status(
            f"{name}: {html.escape(value[:40])} is ignored; use one of {', '.join(allowed)}"
        )
        if str(self._controls[name].value) == value:  # the page may have chosen again
            self._controls[name].value = allowed[0]
        return allowed[0]

    def _change_view(self, _: Any) -> None:
        look.aim(self.client, self._choice("view", look.VIEWS), self.thrown)
        if self.thrown is not None:
            self._water = look.grid(self._choice("view", look.VIEWS), self.thrown)
            if not self._player.playing:
                self._player.play(self.thrown)

    def _download(self, _: Any) -> None:
        file = self.thrown and self._thrower.model_file(self.thrown.settings)
        if file:
            self.client.send_file_download(*file)


def _run_script(client: Any, source: str) -> None:
    """A line of JavaScript on the page: viser has no other way to a page's address."""
    from viser._messages import RunJavascriptMessage

    client.gui._websock_interface.queue_message(RunJavascriptMessage(source=source))


def _request_address(client: Any) -> str:
    """The address that the page was opened with; empty if it does not say."""
    key = f"{KEY} {client.client_id}"
    _run_script(client, f"localStorage.setItem({json.dumps('viser-user:' + key)}, location.href)")
    try:
        address = client.local_storage.get_item(key, timeout=30.0) or ""
        client.local_storage.remove_item(key)
    except (RuntimeError, TimeoutError):
        return ""
    return str(address)


def _set_address(client: Any, query: str) -> None:
    """Make the page's own address the link to its last throw."""
    _run_script(client, f"history.replaceState(null, '', {json.dumps('?' + query)})")
