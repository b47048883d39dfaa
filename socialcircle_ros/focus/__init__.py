# SPDX-License-Identifier: Apache-2.0
"""Focus variation (section 3.1): the focus measure, the fit of its peak, and depth from stacks as frames arrive.

Frames are gray images here. Messages, colour, and the conversion of depth into a cloud live in other rooms.
"""

from .fit import TRUSTED_QUALITY
from .measure import Frame, focus_measure
from .pixel_curve import FocusCurve, PixelCurve
from .reasons import Reason, count_reasons
from .registration import Registered
from .stack import FocusResult, FocusStack, depth_from_focus

__all__ = [
    'TRUSTED_QUALITY',
    'FocusCurve',
    'FocusResult',
    'FocusStack',
    'Frame',
    'PixelCurve',
    'Reason',
    'Registered',
    'count_reasons',
    'depth_from_focus',
    'focus_measure',
]
