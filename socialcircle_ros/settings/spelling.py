# SPDX-License-Identifier: Apache-2.0
"""Names of parameters that are spelled wrong."""

from difflib import get_close_matches

from .groups import PARAMETERS


def nearest_parameter(name: str) -> str | None:
    """The parameter that was meant, perhaps without its group; None if none is spelled like that."""
    whole = (each for each in PARAMETERS if each.endswith(f'.{name}'))
    return next(whole, None) or next(iter(get_close_matches(name, PARAMETERS, n=1)), None)


def no_parameter(name: str) -> str:
    """The sentence that there is no parameter of a name, and which one may be meant."""
    near = nearest_parameter(name)
    return f'There is no parameter {name}; did you mean {near}?' if near else f'There is no parameter {name}.'
