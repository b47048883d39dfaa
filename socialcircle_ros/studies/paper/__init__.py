# SPDX-License-Identifier: Apache-2.0
"""The paper's experiments on clouds of known truth: Table 1, contamination, and figures 4, 8, 10 and 11."""
