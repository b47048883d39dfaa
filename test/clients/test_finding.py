# SPDX-License-Identifier: Apache-2.0
"""The nodes that a tuning page finds in the graph."""

import pytest

from socialcircle_ros.clients.finding import NodeFinder
from socialcircle_ros.errors import SettingError

pytestmark = pytest.mark.live


def test_the_only_node_is_taken_and_one_of_several_is_chosen_by_a_person(start_cell):
    with NodeFinder() as finder:
        assert (finder.nodes(), finder.taken()) == ((), None)
        waiting = 'Waiting for a node; start one with: socialcircle node.'
        assert finder.sentence() == f'{waiting} The graph has no other node.'
        first = start_cell()
        assert first.wait_for(lambda: finder.taken() == first.name)
        second = start_cell()
        names = tuple(sorted((first.name, second.name)))
        first.wait_for(lambda: finder.nodes() == names)
        assert finder.taken() is None
        assert finder.sentence() == f'2 nodes can be tuned; choose one: {", ".join(names)}.'
    with NodeFinder() as found:
        assert second.wait_for(lambda: found.nodes() == names)
    with NodeFinder(cells=(second.namespace, '/nowhere', first.name)) as named:
        assert named.nodes() == (second.name, '/nowhere/social_circle', first.name)
        assert named.taken() == second.name
        assert named.link(second.name) is named.link(second.name)


def test_a_namespace_of_the_arguments_names_the_node():
    with NodeFinder(arguments=('--ros-args', '-r', '__ns:=/cell9')) as finder:
        assert finder.nodes() == ('/cell9/social_circle',)
        assert finder.taken() == '/cell9/social_circle'


def test_a_name_that_no_node_can_have_is_refused_before_anything_is_shown():
    with pytest.raises(SettingError, match="'a name' cannot be the name of a node"):
        NodeFinder(('/cell1/social_circle', 'a name'))
