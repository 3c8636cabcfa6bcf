"""Serving the page: where it listens, whom it lets in, and how it ends."""

from __future__ import annotations

import errno
import socket
import threading
from typing import Any

import rich

from mjskip.errors import MjskipError
from mjskip.play.access import AccessControl, guarded, is_everywhere
from mjskip.play.player import Replay
from mjskip.play.settings import Settings
from mjskip.play.thrown import Thrower
from mjskip.throws.scene import Scene

MAX_TABS = 8
"""Tabs at a time: each streams some 10 MB/s while its stone flies."""


class Playground:
    """A page that throws stones in one scene, served until `close`.

    Attributes:
        url: where it is, with the token that an address beyond this machine needs.
        port: that it listens on.
        tabs: by viser's number of the client.
    """

    def __init__(self, scene: Scene, *, host: str = "127.0.0.1", port: int = 8080) -> None:
        """Begin to serve.

        Args:
            scene: with the stone to throw.
            host: address to listen at; the default is reached from this machine only.
            port: 0 for any that is free.

        Raises:
            MjskipError: viser is missing, or nobody can listen there.
            SceneError: the scene's stone is thrown by an arm.
        """
        thrower, access = Thrower(scene), AccessControl(host)
        try:
            _warm_up(thrower)
            check_free(host, port)
            self._server = _viser_server(host, port, access)
        except BaseException:
            thrower.close()
            raise
        from mjskip.play.tab import Tab

        self._make_tab = Tab
        self._host, self._thrower = host, thrower
        self._lock = threading.Lock()
        self._closed = False
        self.tabs: dict[int, Any] = {}
        self.port = int(self._server.get_port())
        shown = f"[{host}]" if ":" in host else host
        token = f"/?token={access.token}" if access.token else ""
        self.url = f"http://{'localhost' if is_everywhere(host) else shown}:{self.port}{token}"
        self._server.on_client_connect(self._on_connect)
        self._server.on_client_disconnect(self._on_disconnect)
        if port not in (0, self.port):  # taken between the look and the listening
            self.close()
            raise MjskipError(taken(host, port))

    def close(self) -> None:
        """End: every show stops, every page is told."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            tabs, self.tabs = list(self.tabs.values()), {}
        for tab in tabs:
            tab.close()
        self._server.stop()
        self._thrower.close()

    def _on_connect(self, client: Any) -> None:
        with self._lock:
            if self._closed:
                return
            if len(self.tabs) >= MAX_TABS:
                client.add_notification(
                    "Too many tabs",
                    f"This playground serves {MAX_TABS} tabs at a time: close one and reload.",
                    color="red",
                )
                return
            tab = self.tabs[client.client_id] = self._make_tab(client, self._thrower)
        if client.client_id not in self._server.get_clients():  # gone while it was made
            self._on_disconnect(client)
            return
        tab.open_link()

    def _on_disconnect(self, client: Any) -> None:
        with self._lock:
            tab = self.tabs.pop(client.client_id, None)
        if tab is not None:
            tab.close()


def check_free(host: str, port: int) -> None:
    """Raise unless somebody can listen there; viser would take another port without a word.

    Raises:
        MjskipError: the address is not this machine's, or the port is taken.
    """
    try:
        found = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
    except OSError as error:
        raise MjskipError(f"host {host!r} is unknown ({error.strerror}): try 127.0.0.1") from error
    for family, kind, protocol, _, address in found:
        with socket.socket(family, kind, protocol) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                trial.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            try:
                trial.bind(address)
                trial.listen(1)
            except PermissionError as error:
                raise MjskipError(
                    f"port {port} of {host} is not allowed to you: choose one above 1023"
                ) from error
            except OSError as error:
                if error.errno == errno.EADDRINUSE:
                    raise MjskipError(taken(host, port)) from error
                raise MjskipError(
                    f"cannot listen at {host} port {port} ({error.strerror}): give --host an address of this "
                    "machine, such as 127.0.0.1"
                ) from error


def taken(host: str, port: int) -> str:
    """What to say about a port in use."""
    return (
        f"port {port} of {host} is in use: close what listens there, or choose another with --port"
    )


def _viser_server(host: str, port: int, access: AccessControl) -> Any:
    try:
        import viser
    except ImportError as error:
        raise MjskipError(
            f"the playground needs viser ({error}): pip install 'mjskip[play]'"
        ) from error

    class Server(viser.ViserServer):
        """viser's, but no page can make it public."""

        def request_share_url(self, verbose: bool = True) -> None:
            """Any page may ask for a tunnel through a foreign server: never."""

    rich.get_console().quiet = True  # viser's banner and its farewell
    with guarded(access):
        server = Server(host=host, port=port, label="mjskip", verbose=False)
    server.gui.configure_theme(
        show_logo=False, show_share_button=False, brand_color=(11, 114, 133), control_width="medium"
    )
    return server


def _warm_up(thrower: Thrower) -> None:
    """Compile what a throw needs before anybody waits for it."""
    from mjskip.play.surface import DrawnWater

    replay = Replay(thrower.throw(Settings.of_scene(thrower.scene)))
    contacts = replay.thrown.chosen.contacts
    frame = replay.at(contacts[0].entry.time + 0.05 if contacts else 0.05)
    DrawnWater().vertices(frame.water, middle=(0.0, 0.0))
