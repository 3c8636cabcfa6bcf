"""Whom the playground lets in: checks in the handshake, and limits on what a page may send.

viser takes any page of any origin, and frames of 50 MB. `guarded` stands between it and the network: it
answers 403 before a connection exists, and closes connections that send too much, too often, or nothing.
"""

from __future__ import annotations

import asyncio
import hmac
import http
import ipaddress
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import click

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

COOKIE = "mjskip_token"

MAX_CONNECTIONS = 32
"""Pages at a time, those that wait for a free place included."""

LARGEST_FRAME = 2**18
"""Bytes of one message from a page: its controls send some hundred, its address some thousand."""

MAX_MESSAGES = 400
"""Messages a second from a page: a camera that is dragged sends some sixty."""

FIRST_MESSAGE = 15.0
"""Time in which a page must say something [s]: a browser sends its camera at once."""


class AccessControl:
    """The rules of one server.

    Attributes:
        token: that an address beyond this machine must carry; empty on loopback.
    """

    def __init__(self, bound: str) -> None:
        """Set the rules for a server that listens at this address."""
        self._bound = bound
        self._open: set[ServerConnection] = set()
        self.token = "" if is_loopback(bound) else secrets.token_urlsafe(16)

    def refusal(self, request: Request) -> str | None:
        """Why a request is refused; None if it is not."""
        origin, host = request.headers.get("Origin"), request.headers.get("Host")
        if not may_talk(origin, host, bound=self._bound):
            return "this page is not from here"
        if self.token and not self._shows_token(request):
            return "open the address with its token, as `mjskip play` printed it"
        return None

    def admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer of 403 or 503 to a request that is refused."""
        reason = self.refusal(request)
        if reason is not None:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"mjskip play: {reason}\n")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            if len(self._open) >= MAX_CONNECTIONS:
                return connection.respond(
                    http.HTTPStatus.SERVICE_UNAVAILABLE,
                    f"mjskip play: {MAX_CONNECTIONS} pages are open: close one\n",
                )
            self._open.add(connection)
        return None

    def closed(self, connection: ServerConnection) -> None:
        """Make room for another page."""
        self._open.discard(connection)

    def _shows_token(self, request: Request) -> bool:
        query = parse_qs(urlsplit(request.path).query)
        shown = query.get("token", [""])[0]
        try:
            cookie = SimpleCookie(request.headers.get("Cookie", "")).get(COOKIE)
        except CookieError:
            cookie = None
        given = (shown, cookie.value if cookie else "")
        return any(hmac.compare_digest(text.encode(), self.token.encode()) for text in given)


@contextmanager
def guarded(access: AccessControl) -> Iterator[None]:
    """Servers that are started meanwhile obey the access control."""
    import websockets.asyncio.server as library

    serve = library.serve

    def guarded_serve(handler: Any, *args: Any, **kwargs: Any) -> Any:
        kwargs |= {
            "max_size": LARGEST_FRAME,
            "process_request": _checked(access, kwargs.get("process_request")),
            "create_connection": _limited(access),
        }
        return serve(handler, *args, **kwargs)

    library.serve = guarded_serve  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        library.serve = serve  # type: ignore[misc]


def _checked(access: AccessControl, answer: Callable[..., Any] | None) -> Callable[..., Any]:
    """A handshake that is checked first, and gives the page the token as a cookie."""

    def process(connection: ServerConnection, request: Request) -> Response | None:
        refused = access.admit(connection, request)
        if refused is not None or answer is None:
            return refused
        response: Response | None = answer(connection, request)
        if response is not None and access.token:
            response.headers["Set-Cookie"] = (
                f"{COOKIE}={access.token}; HttpOnly; SameSite=Strict; Path=/"
            )
        return response

    return process


def _limited(access: AccessControl) -> type[ServerConnection]:
    """Connections that must speak soon, but not too often."""
    from websockets.asyncio.server import ServerConnection

    class Limited(ServerConnection):
        spoken = False
        second = 0.0
        count = 0

        def connection_lost(self, exc: Exception | None) -> None:
            access.closed(self)
            super().connection_lost(exc)

        async def recv(self, *args: Any, **kwargs: Any) -> Any:
            patience = None if self.spoken else FIRST_MESSAGE
            try:
                message = await asyncio.wait_for(super().recv(*args, **kwargs), patience)
            except TimeoutError:
                await self.close(1008, "this page says nothing")
                return await super().recv()  # raises: the connection is closed
            if not self.spoken:
                asyncio.get_running_loop().set_exception_handler(_say_in_one_line)
            self.spoken = True
            now = time.monotonic()
            if now - self.second >= 1.0:
                self.second, self.count = now, 0
            self.count += 1
            if self.count > MAX_MESSAGES or not isinstance(message, bytes):
                await self.close(1008, "this page sends too much, or what is no message")
                return await super().recv()
            return message

    return Limited


def _say_in_one_line(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """What a page sent that is no message of its kind makes viser stumble: that is told, and no traceback."""
    error = context.get("exception")
    reason = (
        " ".join(f"{type(error).__name__} {error}".split())[:200] if error else context["message"]
    )
    click.echo(f"mjskip play: a page sent what cannot be read ({reason}): ignored", err=True)


def may_talk(origin: str | None, host: str | None, *, bound: str) -> bool:
    """Whether a page of this origin may use a server that was reached by this host.

    Browsers always send an origin with a handshake; programs need not. Where the server is bound to this
    machine only, origin and host must be this machine too, or a page from elsewhere could lead its own
    name here.
    """
    if is_loopback(bound) and not is_loopback(urlsplit(f"//{host}").hostname or ""):
        return False
    return origin is None or origin in (f"http://{host}", f"https://{host}")


def is_loopback(host: str) -> bool:
    """Whether a name or address means this machine only."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_everywhere(host: str) -> bool:
    """Whether an address means every network of this machine."""
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return host == ""
