"""Focus variation (section 3.1): the focus measure, the fit of its peak, and the stack that is measured as it arrives.

Frames are gray here; colour and messages are turned into gray frames elsewhere, and the depth into a cloud.
"""

from .fit import Reason
from .measure import focus_measure
from .stack import FocusResult, FocusStack, depth_from_focus

__all__ = ['FocusResult', 'FocusStack', 'Reason', 'depth_from_focus', 'focus_measure']
