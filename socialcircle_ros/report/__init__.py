# SPDX-License-Identifier: Apache-2.0
"""HTML reports of recordings, and the tables, pages and pictures that other results are shown with.

The filter and the reading of recordings live elsewhere.
"""
