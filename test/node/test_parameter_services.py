# SPDX-License-Identifier: Apache-2.0
"""Both services that set parameters ask this package before rclpy sees a change."""

import rclpy
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node

from socialcircle_ros.errors import SettingError
from socialcircle_ros.node.parameter_services import prepare_changes


def test_a_change_that_is_refused_is_answered_by_each_service_in_the_words_of_the_refusal():
    def refuse(_):
        raise SettingError('not on Sundays')

    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node('parameters', context=context)
    prepare_changes(node, refuse)
    callbacks = {service.srv_type: service.callback for service in node.services}
    answers = {
        kind: callbacks[kind](kind.Request(parameters=[Parameter(name='use_sim_time')]), kind.Response())
        for kind in (SetParameters, SetParametersAtomically)
    }
    node.destroy_node()
    rclpy.shutdown(context=context)
    for result in (*answers[SetParameters].results, answers[SetParametersAtomically].result):
        assert (result.successful, result.reason) == (False, 'not on Sundays')
    assert len(answers[SetParameters].results) == 1
