# SPDX-License-Identifier: Apache-2.0
"""The layouts for Foxglove and RViz show the topics of the node."""

import json
from pathlib import Path

import pytest
import yaml

from socialcircle_ros import interface
from socialcircle_ros.messages import image, point_cloud
from socialcircle_ros.recording.stacks import FRAME_ID

VIEWERS = Path(__file__).resolve().parents[1] / 'viewers'
SHOWN = (interface.POINTS, *interface.CLOUD_OUTPUTS, *interface.STACK_OUTPUTS, interface.STACK_PREVIEW)
CLOUDS = {topic for topic in SHOWN if topic.type == point_cloud.TYPE}
IMAGES = {topic for topic in SHOWN if topic.type == image.TYPE}
AT_START = {interface.FILTERED, interface.MASK}
"""The topics that RViz shows when it opens the configuration."""


@pytest.fixture
def foxglove():
    return json.loads((VIEWERS / 'foxglove.json').read_text(encoding='utf-8'))


@pytest.fixture
def rviz():
    return yaml.safe_load((VIEWERS / 'social_circle.rviz').read_text(encoding='utf-8'))['Visualization Manager']


def panels_in(tree, panels):
    """The panels of a Foxglove layout: a split has two halves, a Tab panel has tabs, a leaf is a panel's name."""
    if not isinstance(tree, str):
        assert tree['direction'] in ('row', 'column')
        assert 0 < tree['splitPercentage'] < 100
        return panels_in(tree['first'], panels) + panels_in(tree['second'], panels)
    tabs = panels[tree]['tabs'] if tree.startswith('Tab!') else []
    return [tree, *(name for tab in tabs for name in panels_in(tab['layout'], panels))]


def test_the_foxglove_layout_shows_each_of_its_panels_once(foxglove):
    assert set(foxglove) == {'configById', 'globalVariables', 'userNodes', 'playbackConfig', 'layout'}
    panels = foxglove['configById']
    assert sorted(panels_in(foxglove['layout'], panels)) == sorted(panels)
    assert all('!' in name for name in panels)


def test_the_foxglove_layout_shows_the_topics_of_the_node(foxglove):
    panels = foxglove['configById']
    clouds = panels['3D!cleaned']['topics']
    assert set(clouds) == {topic.within('') for topic in CLOUDS}
    assert {name for name, style in clouds.items() if style['visible']} == {interface.FILTERED.within('')}
    assert panels['3D!cleaned']['followTf'] == FRAME_ID
    images = {panel['imageMode']['imageTopic'] for name, panel in panels.items() if name.startswith('Image!')}
    assert images == {topic.within('') for topic in IMAGES}
    assert panels['RawMessages!measurement']['topicPath'] == interface.MEASUREMENT.within('')
    assert panels['DiagnosticSummary!health']['topicToRender'] == interface.DIAGNOSTICS.within('')


def test_the_foxglove_layout_shows_the_score_in_a_tab_behind_the_mask(foxglove):
    tabs = foxglove['configById']['Tab!outliers']
    shown = [foxglove['configById'][tab['layout']]['imageMode']['imageTopic'] for tab in tabs['tabs']]
    assert shown == [interface.MASK.within(''), interface.SCORE.within('')]
    assert tabs['activeTabIdx'] == 0


def test_the_rviz_configuration_shows_the_topics_of_the_node_relative_to_its_namespace(rviz):
    shown = {'PointCloud2': set(), 'Image': set()}
    enabled = set()
    for display in rviz['Displays']:
        library, _, kind = display['Class'].partition('/')
        assert library == 'rviz_default_plugins'
        assert display['Enabled'] == display['Value']
        assert display['Topic']['Reliability Policy'] == 'Reliable'
        shown[kind].add(display['Topic']['Value'])
        if display['Enabled']:
            enabled.add(display['Topic']['Value'])
    assert shown['PointCloud2'] == {topic.name for topic in CLOUDS}
    assert shown['Image'] == {topic.name for topic in IMAGES}
    assert enabled == {topic.name for topic in AT_START}


def test_the_rviz_configuration_looks_at_a_part_of_a_millimetre_in_the_frame_of_the_sensor(rviz):
    assert rviz['Global Options']['Fixed Frame'] == FRAME_ID
    assert rviz['Views']['Current']['Near Clip Distance'] < rviz['Views']['Current']['Distance'] / 10
