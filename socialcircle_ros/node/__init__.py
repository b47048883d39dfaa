# SPDX-License-Identifier: Apache-2.0
"""The ROS node: lifecycle, parameters, worker, health. Programs that talk to it from outside are in `clients`."""
