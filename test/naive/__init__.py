# SPDX-License-Identifier: Apache-2.0
"""Slow, obvious references, each to be read beside the paper; every compiled kernel is compared with one."""
