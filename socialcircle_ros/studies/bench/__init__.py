# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: run time against other libraries, growth with the cloud's size, depth error, and the live node."""
