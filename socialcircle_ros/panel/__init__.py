# SPDX-License-Identifier: Apache-2.0
"""The tuning page: what it shows, and which changes it asks of the node.

No rclpy: the page sees the node through the protocol `Link` only. `clients.remote_node` provides it over ROS.
"""
