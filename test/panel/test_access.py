# SPDX-License-Identifier: Apache-2.0
"""Who may open the page: token, hosts and origins."""

import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.panel.access import Access

LOCAL = Access.of('127.0.0.1', ['127.0.0.1'])
OPEN = Access.of('0.0.0.0', ['0.0.0.0'])  # noqa: S104 - nothing listens


def test_each_page_has_a_token_of_its_own_that_cannot_be_guessed():
    assert LOCAL.token != Access.of('127.0.0.1', ['127.0.0.1']).token
    assert len(LOCAL.token) == 48


@pytest.mark.parametrize('host', ['127.0.0.1:8080', 'localhost:9000', 'LocalHost', '[::1]:8080', '127.0.0.2'])
@pytest.mark.parametrize('path', ['', '/', '?websocket=ws://x', '/?websocket=ws://x', '/index.html'])
def test_the_address_that_is_printed_is_accepted_also_through_a_tunnel_with_another_port(host, path):
    assert LOCAL.refusal(f'/{LOCAL.token}{path}', [host], []) == ''
    assert LOCAL.refusal(f'/{LOCAL.token}{path}', [host], [f'http://{host}']) == ''


@pytest.mark.parametrize(
    'hosts',
    [
        [], [''], ['evil.example:8080'], ['0.0.0.0:8080'], ['192.168.0.7:8080'], ['[fe80::1]:8080'],
        ['127.0.0.1.evil.example'], ['localhost.evil.example'], ['evil.example@127.0.0.1'], ['127.0.0.1:8080/x'],
        ['127.0.0.1:port'], ['127.0.0.1:99999'], ['[::1'], ['127.0.0.1', 'evil.example'], ['127.0.0.1'] * 2,
        ['2130706433'], ['127.1'], [' 127.0.0.1'], ['127.0.0.1\\@evil.example'],
    ],
)  # fmt: skip
def test_a_host_that_is_not_this_machine_is_refused_even_with_the_token(hosts):
    assert 'another name' in LOCAL.refusal(f'/{LOCAL.token}', hosts, [])


@pytest.mark.parametrize(
    'origins',
    [
        ['http://evil.example'], ['null'], [''], ['http://127.0.0.1:9999'], ['http://localhost:8080'],
        ['http://127.0.0.1:8080.evil.example'], ['http://127.0.0.1:8080', 'http://evil.example'],
        ['file://'], ['ws://127.0.0.1:8080'],
    ],
)  # fmt: skip
def test_another_origin_is_refused_even_with_the_token(origins):
    assert 'Another web page' in LOCAL.refusal(f'/{LOCAL.token}', ['127.0.0.1:8080'], origins)


@pytest.mark.parametrize('change', ['{:.0}', '{:.47}', '{}0', '0{}'])
@pytest.mark.parametrize('access', [LOCAL, OPEN])
def test_a_missing_or_wrong_token_is_refused_on_every_interface(access, change):
    for path in (
        f'/{change.format(access.token)}',
        f'/?token={access.token}',
        f'//{access.token}',
        f'/x/{access.token}',
    ):
        assert 'token is missing or wrong' in access.refusal(path, ['127.0.0.1:8080'], [])


@given(st.text(), st.lists(st.text(), max_size=2), st.lists(st.text(), max_size=2))
def test_no_request_without_the_token_is_accepted(path, hosts, origins):
    assert OPEN.refusal(path, hosts, origins)
    assert OPEN.refusal(path, ['127.0.0.1'], [])


def test_bytes_in_a_path_that_are_no_text_are_refused():
    assert 'token' in LOCAL.refusal('/\udcff\udc80', ['127.0.0.1'], [])


def test_the_token_is_taken_out_of_the_path():
    assert Access.path_without_token('/token') == '/'
    assert Access.path_without_token('/token/') == '/'
    assert Access.path_without_token('/token/index.html?a=b/c') == '/index.html?a=b/c'
    assert Access.path_without_token('/token?a=b') == '/?a=b'


def test_beyond_loopback_addresses_and_the_names_of_this_machine_are_accepted_and_no_other_name():
    machine = socket.gethostname()
    for host in ('192.168.0.7:8080', '[fe80::1]:8080', 'localhost', machine.upper(), socket.getfqdn()):
        assert OPEN.refusal(f'/{OPEN.token}', [host], []) == ''
    assert 'another name' in OPEN.refusal(f'/{OPEN.token}', ['evil.example:8080'], [])
    named = Access.of('Cell1.factory.example', ['192.168.0.7'])
    assert named.refusal(f'/{named.token}', ['cell1.factory.example:8080'], []) == ''


def test_the_printed_address_can_be_opened():
    assert LOCAL.address(8080) == f'http://127.0.0.1:8080/{LOCAL.token}'
    six = Access.of('::1', ['::1'])
    assert six.address(8080) == f'http://[::1]:8080/{six.token}'
    assert OPEN.address(8080) == f'http://{socket.gethostname()}:8080/{OPEN.token}'
