# SPDX-License-Identifier: Apache-2.0
"""Options of `socialcircle play`; test_live.py plays recordings."""

import click
import pytest

from socialcircle_ros.commands.play import command


@pytest.mark.parametrize(
    ('options', 'topics', 'clock'),
    [
        ('night.mcap', [], 0),
        ('night.mcap --topics /a /b --clock 100', ['/a', '/b'], 100),
        ('night.mcap --topics /a --clock --topics /b /c', ['/a', '/b', '/c'], 40),
        ('--topic /a night.mcap -l --clock', ['/a'], 40),
    ],
)
def test_topics_and_the_clock_are_given_as_to_ros2_bag_play(options, topics, clock):
    given = command.make_context('play', options.split()).params
    assert str(given['recording']) == 'night.mcap'
    assert sorted((*given['topics'], *given['more'])) == topics
    assert given['clock'] == clock


def test_a_recording_after_the_clock_is_no_rate():
    with pytest.raises(click.BadParameter, match='give --clock last'):
        command.make_context('play', ['--clock', 'night.mcap'])
