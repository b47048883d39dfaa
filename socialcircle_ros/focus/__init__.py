"""Focus variation (section 3.1): the focus measure, the fit of its peak, and stacks measured as they arrive.

Frames are gray here; what turns messages and colour into gray frames, and the depth into a cloud, lives
elsewhere.
"""

from .fit import Reason, count_reasons
from .measure import Frame, focus_measure
from .stack import FocusResult, FocusStack, depth_from_focus

__all__ = ['FocusResult', 'FocusStack', 'Frame', 'Reason', 'count_reasons', 'depth_from_focus', 'focus_measure']
