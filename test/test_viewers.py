"""What is shipped for Foxglove and RViz names topics that the node has."""

import json
from pathlib import Path

import yaml

from socialcircle_ros.recording import offline
from socialcircle_ros.recording.stacks import FRAME_ID

VIEWERS = Path(__file__).resolve().parents[1] / 'viewers'
CLOUDS = {offline.INPUT, offline.FILTERED, offline.REPAIRED, offline.STACK_POINTS}
IMAGES = {offline.MASK, offline.STACK_IMAGE}


def panels_in(tree):
    """The panels of a layout of Foxglove: a split has two halves, a leaf is a panel's name."""
    if isinstance(tree, str):
        return [tree]
    assert tree['direction'] in ('row', 'column')
    assert 0 < tree['splitPercentage'] < 100
    return panels_in(tree['first']) + panels_in(tree['second'])


def test_the_layout_for_foxglove_shows_every_panel_once_and_topics_of_the_node():
    layout = json.loads((VIEWERS / 'foxglove.json').read_text())
    assert set(layout) == {'configById', 'globalVariables', 'userNodes', 'playbackConfig', 'layout'}
    panels = layout['configById']
    assert sorted(panels_in(layout['layout'])) == sorted(panels)
    assert all('!' in name for name in panels)
    assert {name.removeprefix('/') for name in panels['3D!cleaned']['topics']} == CLOUDS
    assert panels['3D!cleaned']['followTf'] == FRAME_ID
    images = {panel['imageMode']['imageTopic'] for name, panel in panels.items() if name.startswith('Image!')}
    assert images == {f'/{name}' for name in IMAGES}
    assert panels['RawMessages!measurement']['topicPath'] == f'/{offline.MEASUREMENT}'
    assert panels['DiagnosticSummary!health']['topicToRender'] == '/diagnostics'


def test_the_configuration_for_rviz_shows_topics_of_the_node_in_whatever_namespace_it_runs():
    content = yaml.safe_load((VIEWERS / 'social_circle.rviz').read_text())
    manager = content['Visualization Manager']
    shown = {'PointCloud2': set(), 'Image': set()}
    for display in manager['Displays']:
        library, _, kind = display['Class'].partition('/')
        assert library == 'rviz_default_plugins'
        assert display['Enabled'] == display['Value']
        assert display['Topic']['Reliability Policy'] == 'Reliable'
        shown[kind].add(display['Topic']['Value'])
    assert shown == {'PointCloud2': CLOUDS, 'Image': IMAGES}
    assert manager['Global Options']['Fixed Frame'] == FRAME_ID
    assert manager['Views']['Current']['Near Clip Distance'] < manager['Views']['Current']['Distance'] / 10
