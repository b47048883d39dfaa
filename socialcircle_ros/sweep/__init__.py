# SPDX-License-Identifier: Apache-2.0
"""Filtering the same clouds with many settings, and showing which settings score best.

Scores and pictures come from `metrics` and `report`.
"""
