# SPDX-License-Identifier: Apache-2.0
"""viser's server behind the guard of `access`.

viser offers no hook for requests: it hands its own `process_request` to `websockets`, which answers every request
for a file or a websocket. While viser opens its server, this module puts the guard in front of it. This is the
only place that relies on the inside of viser; where another version works otherwise, no page is served.
"""

import asyncio
import io
import logging
import re
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from socialcircle_ros.errors import SocialCircleError

from .access import Access
from .elements import PRODUCT
from .trends import Trends

TRENDS = '/trends'
"""Path of the page of trends and its reports, after the token."""

_Answer = Response | None
_ProcessRequest = Callable[[ServerConnection, Request], Awaitable[_Answer] | _Answer]
_TITLE = re.compile(rb'<title>.*?</title>', re.DOTALL)

_opening = threading.Lock()


class _OneSentence(logging.Filter):
    """Turns tracebacks of `websockets` about what visitors send into one sentence, or into nothing.

    A handshake fails where a visitor speaks no HTTP, or leaves: viser leaves that out, too, but only after a first
    request.
    """

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether to log the record, which is changed."""
        message = record.getMessage()
        if message == 'connection handler failed' and record.exc_info:
            kind, record.exc_info = record.exc_info[0], None
            record.msg = 'A visitor of the page sent a message that cannot be read (%s); its connection is closed.'
            record.args = (kind.__name__ if kind is not None else '',)
        return message != 'opening handshake failed'


_LOGGER = logging.getLogger(__name__)
_LOGGER.addFilter(_OneSentence())


class _Server(viser.ViserServer):
    """viser's server without its tunnel, through which any visitor could open the page to the internet."""

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002 - as viser declares it
        """Open no tunnel."""
        return None

    def stop(self) -> None:
        """Stop without viser's sentence about it, which no option turns off."""
        with redirect_stdout(io.StringIO()):
            super().stop()


def open_server(host: str, port: int, trends: Trends | None = None) -> tuple[viser.ViserServer, str]:
    """Open the server of the page.

    Args:
        host: the name or the address to listen on.
        port: the port; where it is in use, the next free one is taken. 0: any free port.
        trends: is served under `TRENDS`; None: nothing is.

    Returns:
        The server, and the address of the page with its token. Every other address is refused.

    Raises:
        SocialCircleError: this machine has no such address, or viser's server cannot be guarded.
    """
    access = Access.of(host, _addresses_of(host))
    with _guarding(access, trends or Trends()) as guarded, redirect_stdout(io.StringIO()):  # viser prints a banner
        server = _Server(host=host, port=port, label=PRODUCT, verbose=False)
    if not guarded.is_set():
        server.stop()
        raise SocialCircleError(
            f'The page cannot be protected with viser {viser.__version__}; install: pip install "viser==1.1.*".'
        )
    return server, access.address(server.get_port())


@contextmanager
def _guarding(access: Access, trends: Trends) -> Iterator[threading.Event]:
    """Guard the servers that `websockets` opens meanwhile; the event is set when there is one."""
    guarded = threading.Event()
    serve = websockets.asyncio.server.serve

    def guarded_serve(*arguments: Any, process_request: _ProcessRequest, **options: Any) -> object:
        guarded.set()
        guard = _guard(access, trends, process_request)
        return serve(*arguments, process_request=guard, logger=_LOGGER, **options)

    with _opening:
        websockets.asyncio.server.serve = guarded_serve  # type: ignore[assignment, misc]
        try:
            yield guarded
        finally:
            websockets.asyncio.server.serve = serve  # type: ignore[misc]


def _guard(access: Access, trends: Trends, process_request: _ProcessRequest) -> _ProcessRequest:
    """Answer requests that are refused and those for trends; pass the others on without the token."""

    async def guard(connection: ServerConnection, request: Request) -> _Answer:
        hosts, origins = request.headers.get_all('Host'), request.headers.get_all('Origin')
        reason = access.refusal(request.path, hosts, origins)
        if reason:
            return _page(HTTPStatus.FORBIDDEN, 'text/plain; charset=utf-8', reason.encode())
        path = access.path_without_token(request.path)
        try:
            return await answer(connection, request, path)
        except (OSError, ValueError):  # such as a path that is longer than the name of any file
            return _missing()

    async def answer(connection: ServerConnection, request: Request, path: str) -> _Answer:
        if path.startswith(f'{TRENDS}/'):
            found = await asyncio.to_thread(trends.read, path.removeprefix(f'{TRENDS}/').partition('?')[0])
            if found is None:
                return _missing()
            return _page(HTTPStatus.OK, 'text/html; charset=utf-8', found)
        # Without Accept-Encoding: the title is replaced in a text that is not compressed.
        headers = Headers(item for item in request.headers.raw_items() if item[0].lower() != 'accept-encoding')
        found_file = process_request(connection, Request(path, headers))
        if isinstance(found_file, Awaitable):
            found_file = await found_file
        return found_file if found_file is None else _with_title(found_file)

    return guard


def _with_title(answer: Response) -> Response:
    """The answer with the title of the product, which viser has no option for."""
    body, count = _TITLE.subn(f'<title>{PRODUCT}</title>'.encode(), bytes(answer.body), count=1)
    if not count:
        return answer
    return _page(HTTPStatus.OK, answer.headers['Content-Type'], body)


def _missing() -> Response:
    return _page(HTTPStatus.NOT_FOUND, 'text/plain; charset=utf-8', b'There is no such page.')


def _page(status: HTTPStatus, kind: str, body: bytes) -> Response:
    headers = Headers({
        'Content-Type': kind,
        'Content-Length': str(len(body)),
        'Connection': 'close',
        'Cache-Control': 'no-store',
        'Referrer-Policy': 'no-referrer',  # the address is a secret
        'X-Content-Type-Options': 'nosniff',
    })  # fmt: skip
    return Response(status, status.phrase, headers, body)


def _addresses_of(host: str) -> list[str]:
    """The IP addresses of a host, on which this machine can listen.

    This is checked first, because viser would try one port after the other without end.

    Raises:
        SocialCircleError: this machine has no such address.
    """
    try:
        found = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)
        for family, kind, *_, address in found:
            with socket.socket(family, kind) as trial:
                trial.bind(address)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, 'strerror', None) or 'it is no name of a host'
        raise SocialCircleError(f'The page cannot listen on {host}: {reason}.') from None
    return [str(address[0]) for *_, address in found]
