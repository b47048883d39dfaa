# SPDX-License-Identifier: Apache-2.0
"""Property tests have no deadline here: the first call of a kernel compiles it, which takes seconds."""

from hypothesis import settings

settings.register_profile('compiled', deadline=None)
settings.load_profile('compiled')
