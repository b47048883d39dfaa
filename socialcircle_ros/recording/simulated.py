"""A simulated focus stack as a recording: frames, joint states, and the truth."""

from collections.abc import Callable

import numpy as np

from socialcircle_ros.messages import diagnostics, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.simulation import Simulation

from .stacks import FRAME_ID, add_stack_topics, write_frame, write_joint_state
from .topics import ros_topic
from .writer import RecordingWriter

START = 1_700_000_000_000_000_000  # ns; any fixed time, so that the same simulation gives the same bytes
SURFACE, DESCRIPTION = '/truth/surface', '/truth/description'


def write_simulation(
    simulation: Simulation, writer: RecordingWriter, done: Callable[[int], None] = lambda frames: None
) -> None:
    """Write a stack with its joint states in the order of their times, and what is true of it.

    `truth/surface` is the cloud that a perfect measurement would give: x, y, z in metres, and the field
    `cause` with the trouble that lies in wait there. `truth/description` names the bounds of good and bad.

    Args:
        simulation: the stack, rendered as it is written.
        writer: where to.
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
        # A joint state is known when it is measured, a frame when it is exposed.
        while joints and joints[0][0] <= frame.stamp:
            stamp, z = joints.pop(0)
            write_joint_state(writer, START + int(stamp), float(z) * 1e-6)
        write_frame(writer, START + frame.stamp, frame.image)
        done(frame.index + 1)
    for stamp, z in joints:
        write_joint_state(writer, START + int(stamp), float(z) * 1e-6)


def pitch_of(simulation: Simulation) -> tuple[float, float]:
    """Distance of two pixels along x and y, in metres."""
    grid = simulation.specimen.grid
    return round(grid.dx * 1e-6, 15), round(grid.dy * 1e-6, 15)


def _true_surface(simulation: Simulation) -> bytes:
    truth = simulation.truth
    pitch_x, pitch_y = pitch_of(simulation)
    rows, columns = np.indices(truth.depth.shape)
    xyz = np.dstack([columns * pitch_x, rows * pitch_y, truth.depth * 1e-6])
    return point_cloud.encode_point_cloud(Header.at(START, FRAME_ID), xyz, {'cause': truth.cause})


def _description(simulation: Simulation) -> diagnostics.Status:
    truth = simulation.truth
    values = {
        'good_bound_m': repr(truth.good_bound * 1e-6),
        'bad_bound_m': repr(truth.bad_bound * 1e-6),
        'frames': str(len(simulation)),
        'seed': str(simulation.seed),
        'depth_of_field_m': repr(simulation.optics.depth_of_field * 1e-6),
    }
    return diagnostics.Status(
        diagnostics.OK, 'simulation', 'What the simulated stack was made with.', FRAME_ID, values
    )
