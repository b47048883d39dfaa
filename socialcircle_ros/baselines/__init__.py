"""The filters that the paper compares with (section 4.1), on organized clouds and as fast as ours.

The radius and the statistical filter look for neighbours in a window of the grid instead of a k-d tree, as
the paper re-implements them; the residual to a median window is the baseline that the paper does not have.
`peers` runs PCL's and Open3D's own filters on the same points. The social circle itself lives in `circle`.
"""

from .median import median_filter, window_median
from .radius import radius_filter
from .result import FilterResult
from .statistical import statistical_filter

__all__ = ['FilterResult', 'median_filter', 'radius_filter', 'statistical_filter', 'window_median']
