# SPDX-License-Identifier: Apache-2.0
"""The names under which the topics of a recording are played."""

import pytest

from socialcircle_ros.clients.replay_names import cells_of, names_in_namespace, topic_prefix
from socialcircle_ros.errors import RecordingError, SettingError


@pytest.mark.parametrize(
    ('namespace', 'prefix'), [('', ''), ('/', ''), ('cell1', '/cell1'), ('/cell1/', '/cell1'), ('a/b', '/a/b')]
)
def test_a_namespace_becomes_a_prefix(namespace, prefix):
    assert topic_prefix(namespace) == prefix


@pytest.mark.parametrize('namespace', ['bad x', '1st', 'a//b'])
def test_a_namespace_that_ros_does_not_allow_is_refused(namespace):
    with pytest.raises(SettingError, match=f"'{namespace}' is not a valid namespace"):
        topic_prefix(namespace)


@pytest.mark.parametrize(
    ('recorded', 'played'),
    [
        # One cell: its namespace is replaced.
        (['/cell1/points', '/cell1/truth/outlier_mask'], ['/cell2/points', '/cell2/truth/outlier_mask']),
        (['/line/cell1/stack/image', '/line/cell1/stack/points'], ['/cell2/stack/image', '/cell2/stack/points']),
        (
            ['/cell1/points', '/cell10/other', '/tf', '/clock'],
            ['/cell2' + n for n in ('/points', '/cell10/other', '/tf', '/clock')],
        ),
        (['/cell2/points'], ['/cell2/points']),
        # None, or that of the root.
        (['/points', '/truth/outlier_mask'], ['/cell2/points', '/cell2/truth/outlier_mask']),
        (['/robot/tf', '/joints'], ['/cell2/robot/tf', '/cell2/joints']),
        # Several.
        (['/cell1/points', '/cell3/points', '/tf'], ['/cell2/cell1/points', '/cell2/cell3/points', '/cell2/tf']),
        (['/cell1/points', '/points'], ['/cell2/cell1/points', '/cell2/points']),
    ],
)
def test_a_namespace_takes_the_place_of_that_of_one_cell_and_keeps_several_apart(recorded, played):
    assert names_in_namespace(recorded, '/cell2') == dict(zip(recorded, played, strict=True))


def test_one_cell_can_be_played_in_the_root():
    assert names_in_namespace(['/cell1/points', '/tf'], '') == {'/cell1/points': '/points', '/tf': '/tf'}


def test_two_topics_that_would_get_one_name_are_refused():
    with pytest.raises(RecordingError, match='/tf and /cell1/tf would both be played as /cell2/tf: .* --prefix'):
        names_in_namespace(['/cell1/points', '/tf', '/cell1/tf'], '/cell2')


def test_the_clouds_of_stacks_and_the_masks_of_the_truth_make_no_cell_of_their_own():
    assert cells_of(['/a/stack/points', '/a/stack/image', '/a/truth/outlier_mask', '/tf']) == {'/a'}
