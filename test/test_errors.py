# SPDX-License-Identifier: Apache-2.0
"""What every error has in common."""

import importlib.metadata

import numpy as np
import pytest

from socialcircle_ros.errors import SocialCircleError, install_command, shown

REQUIREMENTS = [
    'numpy>=1.26',
    'viser<2,>=1.1; extra == "panel"',
    "websockets>=13; extra == 'panel'",
    'x; extra == "pan"',
]


def test_bytes_that_are_no_text_become_escapes():
    assert str(SocialCircleError('a \udcff b')) == 'a \\udcff b'


@pytest.mark.parametrize(
    ('value', 'text'),
    [
        ('a', "'a'"),
        (np.ones((2, 1)), 'array([[1.], [1.]])'),
        pytest.param(10**400, f'1{"0" * 59}…', id='400'),
        pytest.param(10**5000, 'a number of thousands of digits', id='5000'),
        pytest.param((10**5000, 1), 'a value of thousands of digits', id='tuple'),
    ],
)
def test_a_value_is_shown_on_one_short_line(value, text):
    assert shown(value) == text


def test_the_command_that_installs_an_extra_names_its_requirements(monkeypatch):
    monkeypatch.setattr(importlib.metadata, 'requires', {'socialcircle_ros': REQUIREMENTS}.get)
    assert install_command('panel') == (
        'pip install "viser<2,>=1.1" "websockets>=13" (in a checkout: pip install -e ".[panel]")'
    )


def not_found(name):
    raise importlib.metadata.PackageNotFoundError(name)


@pytest.mark.parametrize('requires', [not_found, lambda _: None])
def test_without_metadata_the_command_installs_the_source_tree(monkeypatch, requires):
    monkeypatch.setattr(importlib.metadata, 'requires', requires)
    assert install_command('panel') == 'pip install ".[panel]" in the source tree'
