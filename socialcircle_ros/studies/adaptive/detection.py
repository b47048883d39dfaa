# SPDX-License-Identifier: Apache-2.0
"""The rules of the adaptive mode as the experiments call them: one setting for all clouds."""

from socialcircle_ros.circle import CircleResult, remove_outliers
from socialcircle_ros.cloud import Cloud
from socialcircle_ros.settings import CircleSettings

_ADAPTIVE = CircleSettings(mode='adaptive', judge='rules')


def detect(points: Cloud, depth_of_field: float | None = None) -> CircleResult:
    """Filter a cloud (H, W, 3) with the rules of the adaptive mode.

    Args:
        points: the cloud.
        depth_of_field: of the focus stack that gave the heights, in their unit; None without a stack.
    """
    return remove_outliers(points, _ADAPTIVE.of_a_stack(depth_of_field))
