# SPDX-License-Identifier: Apache-2.0
"""Serialized messages in, serialized messages out: what the node does live and `socialcircle filter` offline."""
