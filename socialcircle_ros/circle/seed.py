# SPDX-License-Identifier: Apache-2.0
"""The acquisition of the initial point I (section 3.2.1): where to vote, the votes, and the election."""

from socialcircle_ros.cloud import Cloud
from socialcircle_ros.digits import size_text
from socialcircle_ros.errors import NoSeedError

from .medians import median_distances
from .region import Region, choose_region
from .votes import highest_score, voters


def elect_seed(xyz: Cloud, region: Region | None) -> tuple[int, int]:
    """Return the initial point I: the measured point of the vote region T with the highest score.

    Args:
        xyz: (H, W, 3) organized cloud.
        region: T; points outside the cloud do not vote. None: `choose_region` chooses it.

    Returns:
        Row and column in the cloud; the first point in row order if several have the highest score.

    Raises:
        NoSeedError: no point of the region is measured.
    """
    top, left, height, width = choose_region(xyz) if region is None else region
    area = xyz[top : top + height, left : left + width]
    indices, points = voters(area)
    if len(indices) == 0:
        raise NoSeedError(
            f'No point of the vote region at row {top}, column {left} ({size_text(height, width)}) is measured'
            f' in this cloud of {size_text(*xyz.shape[:2])}; move circle.vote_region, or set it to'
            ' zeros to have it chosen.'
        )
    winner = highest_score(points, median_distances(points))
    row, column = divmod(int(indices[winner]), area.shape[1])
    return top + row, left + column
