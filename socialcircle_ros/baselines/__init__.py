# SPDX-License-Identifier: Apache-2.0
"""The filters that the paper compares with (section 4.1), on organized clouds; the social circle is in `circle`.

The radius and the statistical filter search for neighbours in a window of the grid instead of a k-d tree, as the
paper implements them. The residual to a median window is an additional baseline. `peers` runs the filters of PCL
and Open3D on the same points.
"""

from .median import median_filter, window_median
from .radius import radius_filter
from .result import FilterResult
from .statistical import statistical_filter

__all__ = ['FilterResult', 'median_filter', 'radius_filter', 'statistical_filter', 'window_median']
