# SPDX-License-Identifier: Apache-2.0
"""Research on the filter and benchmarks, separate from the product; nothing but `commands` imports them."""
