# SPDX-License-Identifier: Apache-2.0
"""Numbers that describe a mask or a surface: scores against a truth, areal surface texture. No files."""
