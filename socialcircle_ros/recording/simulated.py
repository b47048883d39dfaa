# SPDX-License-Identifier: Apache-2.0
"""A simulated focus stack as a recording: frames, joint states, and the true surface."""

from collections.abc import Callable

import numpy as np

from socialcircle_ros.messages import diagnostics, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.simulation import Simulation

from .stacks import FRAME_ID, add_stack_topics, write_frame, write_joint_state
from .topics import ros_topic
from .writer import RecordingWriter

START = 1_700_000_000_000_000_000
"""Time of the first message, ns. It is fixed, so that the same simulation gives the same bytes."""

SURFACE, DESCRIPTION = '/truth/surface', '/truth/description'
"""The topics of the true surface, and of the bounds by which a depth is good or bad."""

_METRES_PER_UM = 1e-6


def write_simulation(
    simulation: Simulation, writer: RecordingWriter, done: Callable[[int], None] = lambda frames: None
) -> None:
    """Write a simulated stack with its joint states in the order of their times, and its true surface.

    `/truth/surface` is the cloud of a perfect measurement: x, y, z in metres, and the field `cause` with the
    causes of error at each point. `/truth/description` holds the bounds of good and bad depths.

    Args:
        simulation: the stack; its frames are rendered while they are written.
        writer: the recording.
        done: called with the number of frames written so far.
    """
    add_stack_topics(writer)
    writer.add_topic(ros_topic(SURFACE, point_cloud.TYPE))
    writer.add_topic(ros_topic(DESCRIPTION, diagnostics.TYPE))
    travel = simulation.travel
    writer.write(SURFACE, _true_surface(simulation), START)
    writer.write(DESCRIPTION, _description(simulation).encode(), START)
    joints = list(zip(travel.joint_stamps, travel.joint_z, strict=True))
    for frame in simulation.frames():
        while joints and joints[0][0] <= frame.stamp:
            stamp, z = joints.pop(0)
            write_joint_state(writer, START + int(stamp), float(z) * _METRES_PER_UM)
        write_frame(writer, START + frame.stamp, frame.image)
        done(frame.index + 1)
    for stamp, z in joints:
        write_joint_state(writer, START + int(stamp), float(z) * _METRES_PER_UM)


def pitch_of(simulation: Simulation) -> tuple[float, float]:
    """Distance of two pixels along x and along y, in metres."""
    grid = simulation.specimen.grid
    return round(grid.dx * _METRES_PER_UM, 15), round(grid.dy * _METRES_PER_UM, 15)


def _true_surface(simulation: Simulation) -> bytes:
    """The cloud of a perfect measurement, serialized."""
    truth = simulation.truth
    pitch_x, pitch_y = pitch_of(simulation)
    rows, columns = np.indices(truth.depth.shape)
    xyz = np.dstack([columns * pitch_x, rows * pitch_y, truth.depth * _METRES_PER_UM])
    return point_cloud.encode_point_cloud(Header.at(START, FRAME_ID), xyz, {'cause': truth.cause})


def _description(simulation: Simulation) -> diagnostics.Status:
    """The bounds of good and bad depths, and how the stack was made."""
    truth = simulation.truth
    values = {
        'good_bound_m': repr(truth.good_bound * _METRES_PER_UM),
        'bad_bound_m': repr(truth.bad_bound * _METRES_PER_UM),
        'frames': str(len(simulation)),
        'seed': str(simulation.seed),
        'depth_of_field_m': repr(simulation.optics.depth_of_field * _METRES_PER_UM),
    }
    return diagnostics.Status(
        diagnostics.OK, 'simulation', 'What the simulated stack was made with.', FRAME_ID, values
    )
