# SPDX-License-Identifier: Apache-2.0
"""The adaptive mode's experiments: simulated stacks, measured surfaces and run time, compared with its goals."""
