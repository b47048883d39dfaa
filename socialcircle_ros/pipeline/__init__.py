"""Serialized messages in, serialized messages out: what the node does live and `socialcircle filter` offline."""
