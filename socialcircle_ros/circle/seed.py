"""The election of the initial point I (section 3.2.1)."""

import numpy as np

from socialcircle_ros.cloud import Cloud
from socialcircle_ros.errors import NoSeedError

from .medians import median_distances
from .region import Region, choose_region
from .votes import estimate_scores, voters, votes_received


def elect_seed(xyz: Cloud, region: Region | None) -> tuple[int, int]:
    """The initial point I: the measured point of the vote region T with the highest score.

    Args:
        xyz: (H, W, 3) organized cloud.
        region: T; what of it lies outside the cloud does not vote. None: `choose_region`.

    Returns:
        Row and column in the cloud; of points with equal scores the first in row order.

    Raises:
        NoSeedError: no point of the region is measured.
    """
    top, left, height, width = choose_region(xyz) if region is None else region
    square = xyz[top : top + height, left : left + width]
    places, x, y, z = voters(square)
    if len(places) == 0:
        raise NoSeedError(
            f'No point of the vote region at row {top}, column {left} ({height}×{width} points) is measured'
            f' in this cloud of {xyz.shape[0]}×{xyz.shape[1]} points; move circle.vote_region, or set it to'
            ' zeros to have it chosen.'
        )
    mu = median_distances(x, y, z)
    estimates, margin = estimate_scores(x, y, z, mu)
    contenders = np.flatnonzero(estimates >= estimates.max() - margin)
    winner = contenders[np.argmax(votes_received(x, y, z, mu, contenders))]
    row, column = divmod(int(places[winner]), square.shape[1])
    return top + row, left + column
