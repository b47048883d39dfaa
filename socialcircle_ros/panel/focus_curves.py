# SPDX-License-Identifier: Apache-2.0
"""The focus curve of a pixel from the frames of a recording."""

import dataclasses
from collections.abc import Iterable

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import FocusCurve, PixelCurve
from socialcircle_ros.interface import STACK_FRAMES, STACK_JOINT_STATES
from socialcircle_ros.pipeline.stack_cloud import StackCloud
from socialcircle_ros.pipeline.stacks import StackAssembler
from socialcircle_ros.settings import FocusSettings, PipelineSettings

from .link import StackMessage


def focus_curve(
    messages: Iterable[StackMessage], settings: PipelineSettings, place: tuple[int, int]
) -> FocusCurve:
    """Measure a stack again, and keep the focus curve of one pixel.

    Args:
        messages: frames and stage positions of the stack.
        settings: how it is measured.
        place: row and column of the pixel.

    Raises:
        StackError: the frames give no cloud.
    """
    pixels: list[PixelCurve] = []

    def of_pixel(focus: FocusSettings) -> PixelCurve:
        pixels.append(PixelCurve(focus, place))
        return pixels[-1]

    assembler = StackAssembler(of_pixel)
    assembler.configure(settings.focus, dataclasses.replace(settings.stack, preview=0))
    add = {STACK_FRAMES: assembler.add_frame, STACK_JOINT_STATES: assembler.add_joint_state}
    reason = 'they end before the stack does.'
    events = (event for message in messages for event in add[message.topic](message.data))
    for source in (events, assembler.finish()):
        for event in source:
            if not isinstance(event, StackCloud):
                reason = event.reason
            elif pixels[-1].curve is not None:
                return pixels[-1].curve
    raise StackError(f'The frames give no focus curve: {reason}')
