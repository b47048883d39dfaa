# SPDX-License-Identifier: Apache-2.0
"""What every error has in common."""

import importlib.metadata

import pytest

from socialcircle_ros.errors import SocialCircleError, install_command

REQUIREMENTS = [
    'numpy>=1.26',
    'viser<2,>=1.1; extra == "panel"',
    "websockets>=13; extra == 'panel'",
    'x; extra == "pan"',
]


def test_bytes_that_are_no_text_become_escapes():
    assert str(SocialCircleError('a \udcff b')) == 'a \\udcff b'


def test_the_command_that_installs_an_extra_names_its_requirements(monkeypatch):
    monkeypatch.setattr(importlib.metadata, 'requires', {'socialcircle_ros': REQUIREMENTS}.get)
    assert install_command('panel') == 'pip install "viser<2,>=1.1" "websockets>=13"'


def not_found(name):
    raise importlib.metadata.PackageNotFoundError(name)


@pytest.mark.parametrize('requires', [not_found, lambda _: None])
def test_without_metadata_the_command_installs_the_source_tree(monkeypatch, requires):
    monkeypatch.setattr(importlib.metadata, 'requires', requires)
    assert install_command('panel') == 'pip install ".[panel]" in the source tree'
