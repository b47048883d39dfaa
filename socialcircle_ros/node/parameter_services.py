# SPDX-License-Identifier: Apache-2.0
"""The services that change parameters: what they ask for is looked at before rclpy looks at it."""

from collections.abc import Callable, Sequence

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node

from socialcircle_ros.errors import SettingError

from .rclpy_internals import services_that_set_parameters

Prepared = Callable[[Sequence[ParameterMessage]], list[ParameterMessage]]
"""Takes changes that are asked for together, and gives them as rclpy is to see them; SettingError refuses them."""


def prepare_changes(node: Node, prepared: Prepared) -> None:
    """Have the changes of parameters that services ask for prepared or refused before rclpy sees them.

    rclpy does not answer where it does not know the type of a value, refuses in words of its own, and lets a
    refused value change the parameter's description.
    """
    for kind, service in services_that_set_parameters(node).items():
        wrapped = _one_by_one if kind is SetParameters else _together
        service.callback = wrapped(service.callback, prepared)


def _one_by_one(
    set_parameters: Callable[[SetParameters.Request, SetParameters.Response], SetParameters.Response],
    prepared: Prepared,
) -> Callable[[SetParameters.Request, SetParameters.Response], SetParameters.Response]:
    def callback(request: SetParameters.Request, response: SetParameters.Response) -> SetParameters.Response:
        for change in request.parameters:
            try:
                one = SetParameters.Request(parameters=prepared([change]))
            except SettingError as refusal:  # noqa: PERF203 - each change has a result
                response.results.append(SetParametersResult(successful=False, reason=str(refusal)))
            else:
                response = set_parameters(one, response)  # it appends the result
        return response

    return callback


def _together(
    set_parameters: Callable[
        [SetParametersAtomically.Request, SetParametersAtomically.Response], SetParametersAtomically.Response
    ],
    prepared: Prepared,
) -> Callable[
    [SetParametersAtomically.Request, SetParametersAtomically.Response], SetParametersAtomically.Response
]:
    def callback(
        request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        try:
            request.parameters = prepared(request.parameters)
        except SettingError as refusal:
            response.result = SetParametersResult(successful=False, reason=str(refusal))
            return response
        return set_parameters(request, response)

    return callback
