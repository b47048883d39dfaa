# SPDX-License-Identifier: Apache-2.0
"""Who may open the page: a secret token in its address, and lists of the hosts and origins that are accepted.

A page on the loopback address is within reach of every web page in the same browser: such a page can open a
websocket to it, and with DNS rebinding it can read it. Only the holder of the token gets an answer here; the
lists of hosts and origins refuse other web pages even if they know the token.
"""

import ipaddress
import secrets
import socket
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from urllib.parse import urlsplit

_TOKEN_BYTES = 24

_OTHER_HOST = 'This server has another name; open the address that socialcircle tune has printed.'
_OTHER_ORIGIN = 'Another web page has asked for the tuning page; open the address in a tab of its own.'
_NOT_THE_ADDRESS = 'The token is missing or wrong; open the whole address that socialcircle tune has printed.'


@dataclass(frozen=True)
class Access:
    """The conditions under which a request is answered.

    Attributes:
        token: the first part of the path of each request.
        shown_host: the host in the address that is printed.
        names: the host names that are accepted, in lower case.
        beyond_loopback: whether each IP address is accepted as the host, and not only the loopback addresses. A
            rebound DNS name is never an IP address.
    """

    token: str
    shown_host: str
    names: frozenset[str]
    beyond_loopback: bool

    @classmethod
    def of(cls, host: str, addresses: Iterable[str]) -> 'Access':
        """The conditions of a server, with a new token.

        Args:
            host: the name or the address that it listens on, as it was given.
            addresses: the IP addresses of `host`.
        """
        listening = [ipaddress.ip_address(address) for address in addresses]
        beyond = not all(address.is_loopback for address in listening)
        machine = socket.gethostname()
        names, shown = {'localhost'}, host
        if beyond:
            names |= {machine, socket.getfqdn(), f'{machine.partition(".")[0]}.local'}
        if any(address.is_unspecified for address in listening):
            shown = machine
        elif _address_of(host) is None:
            names.add(host)
        return cls(secrets.token_hex(_TOKEN_BYTES), shown, frozenset(map(str.lower, names)), beyond)

    def address(self, port: int) -> str:
        """The address of the page, with the token."""
        host = f'[{self.shown_host}]' if ':' in self.shown_host else self.shown_host
        return f'http://{host}:{port}/{self.token}'

    def refusal(self, path: str, hosts: Sequence[str], origins: Sequence[str]) -> str:
        """Decide on a request, be it for a file or for a websocket.

        A program that is no browser sends no origin; it needs the token all the same.

        Args:
            path: of the request, as it was sent.
            hosts: the values of its headers `Host`.
            origins: the values of its headers `Origin`.

        Returns:
            '' or one sentence that says why it is refused.
        """
        if len(hosts) != 1 or not self._accepts_host(hosts[0]):
            return _OTHER_HOST
        own = {f'{scheme}://{hosts[0]}'.lower() for scheme in ('http', 'https')}
        if not own.issuperset(origin.lower() for origin in origins):
            return _OTHER_ORIGIN
        token, _ = _split(path)
        if not secrets.compare_digest(_octets(token), _octets(self.token)):
            return _NOT_THE_ADDRESS
        return ''

    @staticmethod
    def path_without_token(path: str) -> str:
        """The path of a request that was not refused, as if there were no token."""
        return _split(path)[1]

    def _accepts_host(self, host: str) -> bool:
        try:
            parts = urlsplit(f'//{host}')
            name, _ = parts.hostname, parts.port  # a port that is none raises ValueError
        except ValueError:
            return False
        if name is None or '@' in host or parts.netloc != host:
            return False
        address = _address_of(name)
        if address is None:
            return name in self.names
        return address.is_loopback or self.beyond_loopback


def _split(path: str) -> tuple[str, str]:
    """The first part of a path, and the rest with its leading slash."""
    location, _, query = path.partition('?')
    token, _, rest = location.removeprefix('/').partition('/')
    return token, f'/{rest}' + (f'?{query}' if query else '')


def _address_of(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The IP address in a text; None for a name."""
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


def _octets(text: str) -> bytes:
    return text.encode('utf-8', 'surrogatepass')
