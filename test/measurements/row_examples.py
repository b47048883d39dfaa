# SPDX-License-Identifier: Apache-2.0
"""Rows for tests: of real measurements of a small cloud, and of recordings that cannot be read."""

from examples import cloud

from socialcircle_ros.measurements import Origin, SettingsText, row_of
from socialcircle_ros.metrics.areal import Texture
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.settings import PipelineSettings

NOON = 1_790_000_000_000_000_000
"""2026-09-21 14:13:20 UTC, in ns."""


def origin(**changes):
    values = {
        'source': 'batch',
        'recording': 'nights/a.mcap',
        'content': 'abc',
        'cell': 'cell1',
        'part': 'lid',
        'topic': '/cell1/points',
        'number': 3,
        'time_ns': NOON,
        'settings': SettingsText.of(PipelineSettings()),
        'version': '1.2.3',
    }
    return Origin(**{**values, **changes})


def measurement(stamp=NOON, **options):
    return filter_cloud(cloud(stamp=stamp, **options)).measurement


def row(stamp=NOON, **changes):
    return row_of(origin(**changes), measurement(stamp), Texture(0.1, 0.2, 3.0))
