# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled and shared among threads and cores, and small algorithms that several rooms use.

Nothing here knows a cloud: what is specific to one method lives with that method.
"""
