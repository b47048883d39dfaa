# SPDX-License-Identifier: Apache-2.0
"""Names that are spelled almost like one that a person typed."""

from collections.abc import Iterable
from difflib import get_close_matches


def nearest_name(name: str, names: Iterable[str]) -> str | None:
    """The name that is spelled most like another one; None if none is near."""
    return next(iter(get_close_matches(name, names, n=1)), None)
