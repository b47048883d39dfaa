# SPDX-License-Identifier: Apache-2.0
"""Outlier filters compared on clouds of known truth: clouds, filters, settings search and shared pictures.

The experiments that use the comparison are in `paper` and `adaptive`.
"""
