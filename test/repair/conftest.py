"""Compiled code takes seconds on its first call, which no deadline of a property test foresees."""

from hypothesis import settings

settings.register_profile('compiled', deadline=None)
settings.load_profile('compiled')
