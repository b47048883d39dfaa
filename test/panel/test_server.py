# SPDX-License-Identifier: Apache-2.0
"""The server of the page against visitors that do not hold its token: raw requests, and web pages in Chromium."""

import base64
import contextlib
import http.client
import http.server
import itertools
import logging
import socket
import threading
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from browser import Visitor, browser

viser = pytest.importorskip('viser', reason='the page needs viser')

import msgspec  # noqa: E402 - these come with viser
import zstandard  # noqa: E402
from websockets.asyncio import server as websocket_server  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

from socialcircle_ros.errors import SocialCircleError  # noqa: E402
from socialcircle_ros.panel.server import open_server  # noqa: E402

CLOUD = 'the cloud of the customer'
PROTOCOL = f'viser-v{viser.__version__}'


@pytest.fixture(scope='module')
def served():
    server, address = open_server('127.0.0.1', 0)
    server.gui.add_html(CLOUD)
    parts = urlsplit(address)
    yield SimpleNamespace(
        server=server, address=address, host=parts.netloc, port=parts.port, token=parts.path.removeprefix('/')
    )
    server.stop()


def test_nothing_is_printed_when_it_is_opened_and_stopped(capfd):
    server, _ = open_server('127.0.0.1', 0)
    server.stop()
    assert capfd.readouterr() == ('', '')


def visit(served):
    return connect(f'ws://{served.host}/{served.token}', subprotocols=[PROTOCOL], max_size=None)


def status_of(served, path, headers, *, websocket):
    """The status of a request: 101 if a websocket is opened."""
    connection = http.client.HTTPConnection('127.0.0.1', served.port, timeout=300)
    upgrade = {
        'Connection': 'Upgrade',
        'Upgrade': websocket if isinstance(websocket, str) else 'websocket',
        'Sec-WebSocket-Key': base64.b64encode(bytes(16)).decode(),
        'Sec-WebSocket-Version': '13',
        'Sec-WebSocket-Protocol': PROTOCOL,
    }
    with contextlib.closing(connection):
        connection.request('GET', path, headers={**(upgrade if websocket else {}), **headers})
        response = connection.getresponse()
        if response.status != 101:
            assert CLOUD.encode() not in response.read()
        return response.status


@pytest.mark.parametrize(('websocket', 'accepted'), [(False, 200), (True, 101)])
def test_the_holder_of_the_token_is_answered(served, websocket, accepted):
    path = f'/{served.token}'
    assert status_of(served, path, {}, websocket=websocket) == accepted
    assert status_of(served, path, {'Host': f'localhost:{served.port}'}, websocket=websocket) == accepted
    assert status_of(served, path, {'Origin': f'http://{served.host}'}, websocket=websocket) == accepted


@pytest.mark.parametrize('websocket', [False, True, 'WebSocket'])
def test_without_the_token_from_another_origin_or_for_another_host_there_is_no_answer(served, websocket):
    token = f'/{served.token}'
    refused = [
        *itertools.product(['/', '/index.html', '/?token=', f'/{"0" * 48}', f'/?token={served.token}'], [{}]),
        (token, {'Origin': 'http://evil.example'}),
        (token, {'Origin': 'null'}),
        (token, {'Origin': f'http://127.0.0.1:{served.port + 1}'}),
        (token, {'Host': f'evil.example:{served.port}'}),
        (token, {'Host': f'evil.example:{served.port}', 'Origin': f'http://evil.example:{served.port}'}),
        (token, {'Host': f'0.0.0.0:{served.port}', 'Origin': f'http://0.0.0.0:{served.port}'}),
    ]
    assert [status_of(served, *request, websocket=websocket) for request in refused] == [403] * len(refused)


def test_a_server_of_the_network_wants_the_token_too():
    server, address = open_server('0.0.0.0', 0)  # noqa: S104 - that is what is tested
    parts = urlsplit(address)
    network = SimpleNamespace(port=parts.port)
    assert parts.hostname == socket.gethostname().lower()
    for websocket, accepted in ((False, 200), (True, 101)):
        assert status_of(network, '/', {}, websocket=websocket) == 403
        assert status_of(network, parts.path, {}, websocket=websocket) == accepted
        assert status_of(network, parts.path, {'Host': parts.netloc}, websocket=websocket) == accepted
        assert status_of(network, parts.path, {'Host': 'evil.example'}, websocket=websocket) == 403
    server.stop()


def test_a_websocket_with_the_token_receives_the_page(served):
    with visit(served) as connection:
        assert connection.recv(timeout=300)


@pytest.mark.parametrize('message', [b'\0garbage', b'\x81\xa4type', b'\xdd\xff\xff\xff\xff', b'\x90', 'text'])
def test_a_message_that_cannot_be_read_is_told_in_one_sentence(served, logged, message):
    with visit(served) as connection:
        connection.send(message)
        with pytest.raises(ConnectionClosed):
            while connection.recv(timeout=300):
                pass
    (record,) = logged()
    assert record.exc_info is None
    assert 'sent a message that cannot be read' in record.getMessage()


@pytest.mark.parametrize('path', ['', 'trends/'])
def test_a_path_longer_than_any_name_of_a_file_is_no_page(served, logged, path):
    assert status_of(served, f'/{served.token}/{path}{"a" * 3000}', {}, websocket=False) == 404
    assert logged() == []


def test_what_is_no_request_is_not_logged(logged):
    server, address = open_server('127.0.0.1', 0)
    with socket.create_connection(('127.0.0.1', urlsplit(address).port)) as visitor:
        visitor.sendall(b'\0\1\2\r\n\r\n')
        assert visitor.recv(1000) == b''
    server.stop()
    assert [record.getMessage() for record in logged() if record.levelno > logging.INFO] == []


def test_the_title_is_the_product_s(served, chromium):
    visitor = Visitor(chromium, served.address, tab=None)
    assert visitor.page.title() == 'Social circle'
    assert visitor.sees(CLOUD)
    visitor.page.reload()
    assert visitor.sees(CLOUD)
    visitor.leave()


ATTACK = """
async ({addresses, protocol}) => {
    const open = address => new Promise(resolve => {
        const socket = new WebSocket(address, [protocol]);
        socket.onopen = () => resolve('opened');
        socket.onmessage = () => resolve('read');
        socket.onerror = () => resolve('refused');
    });
    const read = address => fetch(address).then(answer => answer.text()).catch(() => 'refused');
    const results = [];
    for (const address of addresses)
        results.push(await open('ws://' + address), await read('http://' + address));
    return results;
}
"""


@pytest.fixture(scope='module')
def foreign():
    """The address of another web page on this machine."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b'<title>a foreign page</title>')

        def log_message(self, *arguments):
            pass

    server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f'http://127.0.0.1:{server.server_port}'
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.mark.parametrize('host', ['127.0.0.1', 'localhost'])
def test_a_foreign_page_in_the_same_browser_reads_nothing_even_if_it_knows_the_token(
    served, foreign, chromium, host
):
    page = chromium.new_page()
    page.goto(foreign.replace('127.0.0.1', host))
    addresses = [
        f'{name}:{served.port}/{path}' for name in ('127.0.0.1', 'localhost') for path in ('', served.token)
    ]
    results = page.evaluate(ATTACK, {'addresses': addresses, 'protocol': PROTOCOL})
    assert results == ['refused'] * 2 * len(addresses)
    page.close()


def test_dns_rebinding_is_refused(served):
    with browser('--host-resolver-rules=MAP evil.example 127.0.0.1') as chromium:
        page = chromium.new_page()
        for path in ('', served.token):
            answer = page.goto(f'http://evil.example:{served.port}/{path}')
            assert answer.status == 403
            assert 'another name' in page.content()
        addresses = [f'evil.example:{served.port}/{path}' for path in ('', served.token)]
        results = page.evaluate(ATTACK, {'addresses': addresses, 'protocol': PROTOCOL})
        assert [result for result in results if 'another name' not in result] == ['refused', 'refused']


def test_a_visitor_opens_no_tunnel_from_the_internet(served, monkeypatch):
    monkeypatch.setattr('viser._viser.ViserTunnel', lambda *_: pytest.fail('a tunnel was opened'))
    assert served.server.request_share_url() is None
    requested = threading.Event()
    monkeypatch.setattr(served.server, 'request_share_url', requested.set)
    with visit(served) as connection:
        connection.send(msgspec.msgpack.encode({'type': 'ShareUrlRequest'}))
        assert requested.wait(60)


def test_a_visitor_that_sends_nonsense_does_not_end_the_page_of_the_others(served):
    with visit(served) as other:
        other.recv(timeout=300)
        for nonsense in (b'\xff' * 1000, 'a text', msgspec.msgpack.encode({'type': 'Nonsense'})):
            with visit(served) as connection, pytest.raises(ConnectionClosed):
                connection.send(nonsense)
                while True:
                    connection.recv(timeout=300)
        served.server.gui.add_markdown('news')
        while b'news' not in zstandard.decompress(other.recv(timeout=300)[16:], max_output_size=1 << 20):
            pass


def test_no_page_is_served_if_viser_does_not_use_the_guarded_server(monkeypatch):
    serve = websocket_server.serve
    elsewhere = SimpleNamespace(asyncio=SimpleNamespace(server=SimpleNamespace(serve=serve)))
    monkeypatch.setattr('viser.infra._infra.websockets', elsewhere)
    with pytest.raises(SocialCircleError, match='cannot be protected with viser'):
        open_server('127.0.0.1', 0)


def test_other_servers_of_the_process_are_not_changed():
    assert websocket_server.serve.__module__ == 'websockets.asyncio.server'


def test_an_address_of_another_machine_is_refused():
    with pytest.raises(SocialCircleError, match=r'cannot listen on 192\.0\.2\.1'):
        open_server('192.0.2.1', 0)


def test_a_request_that_is_no_http_leaves_the_server_running(served, caplog):
    with (
        caplog.at_level(logging.CRITICAL),
        contextlib.closing(http.client.HTTPConnection('127.0.0.1', served.port, timeout=300)) as connection,
    ):
        connection.connect()
        connection.sock.sendall(b'\x00\xff\r\n' * 1000)
        with contextlib.suppress(ConnectionError):
            while connection.sock.recv(1000):
                pass
    assert status_of(served, f'/{served.token}', {}, websocket=False) == 200
