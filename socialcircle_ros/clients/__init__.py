# SPDX-License-Identifier: Apache-2.0
"""Clients of a running node: node process, cloud client, player, recorder, round trips, and the remote node.

Nothing here filters. What the tuning page shows is in `panel`, the node itself in `node`.
"""
