# SPDX-License-Identifier: Apache-2.0
"""What a report shows of the focus stack that a cloud was measured from."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from socialcircle_ros.digits import share_text
from socialcircle_ros.focus import TRUSTED_QUALITY
from socialcircle_ros.messages.image import Image
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.pictures.drawings import CloudPictures
from socialcircle_ros.recording.offline import SourceCloud

from .content import Cell, Column, Picture, Pictures, Table

_SENTENCES = {
    'no_peak': 'no peak that noise would not make too',
    'scan_end': 'sharpest at the end of the scan',
    'saturated': 'saturated',
    'two_peaks': 'a second peak',
    'low_contrast': 'little contrast',
    'incomplete': 'frames came out of order',
    'out_of_picture': 'left the picture in some registered frame',
    'few_pixels': 'a few pixels have most of the texture near',
}
"""What each reason means, in a table."""


@dataclass(frozen=True)
class StackSummary:
    """The stack of one cloud: a table and two pictures.

    Attributes:
        table: frames, step, quality, and the number of pixels for each reason.
        pictures: the picture in focus, and the map of the quality.
    """

    table: Table
    pictures: Pictures


def summarize_stack(
    name: str, source: SourceCloud, cloud: PointCloud, drawn: CloudPictures
) -> StackSummary | None:
    """Describe the stack of a cloud; None: the cloud is not from a stack.

    Args:
        name: of the cloud, for its pictures.
        source: what is known of the stack.
        cloud: the cloud.
        drawn: draws the cloud.
    """
    if source.image is None:
        return None
    quality = cloud.values('quality').astype(np.float32)
    image = Image.decode(source.image)
    pixels = image.pixels()
    if image.blue_first:
        pixels = pixels[..., ::-1]
    pictures = [
        Picture('in_focus', drawn.in_focus(pixels), '', f'{name}: picture in focus'),
        Picture('quality', drawn.quality(quality), '', f'{name}: quality'),
    ]
    rows = list(_rows(source, quality.size, float(np.mean(quality >= TRUSTED_QUALITY))))
    return StackSummary(Table('', 'Focus stack', (Column(''), Column('')), rows), Pictures(pictures))


def _rows(source: SourceCloud, points: int, trusted: float) -> Iterator[list[Cell]]:
    yield ['frames', f'{source.frames}']
    yield ['step of the focus measure', f'{source.focus_step} pixels']
    if source.drift is not None:
        yield ['sideways drift', f'{source.drift:.1f} pixels']
    yield [f'quality of at least {TRUSTED_QUALITY}', f'{share_text(trusted, 1)} of the pixels']
    if source.registered is not None:
        yield [
            'registered',
            f'{source.registered.moved:.1f} pixels, magnification {source.registered.magnification:.4f}',
        ]
    for reason, count in source.reasons.items():
        if count:
            yield [_SENTENCES.get(reason, reason), f'{count:,} ({share_text(count / points, 1)})']
