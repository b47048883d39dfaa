# SPDX-License-Identifier: Apache-2.0
"""The only rclpy code: lifecycle node, parameters, worker, health."""
