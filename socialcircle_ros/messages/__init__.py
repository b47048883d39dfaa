# SPDX-License-Identifier: Apache-2.0
"""Serialized ROS messages (CDR) to arrays and back, without rclpy.

Messages are read in place. Recordings of messages are in `recording`.
"""
