"""A simulated focus stack as a recording: frames, joint states, and the truth."""

from collections.abc import Callable

import numpy as np

from socialcircle_ros.messages import diagnostics, image, joint_state, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.settings import RosValue
from socialcircle_ros.simulation import Simulation

from .topics import ros_topic
from .writer import RecordingWriter

START = 1_700_000_000_000_000_000  # ns; any fixed time, so that the same simulation gives the same bytes
FRAME = 'microscope'
JOINT = 'stage_z'
TOPICS = {
    'stack/image': image.TYPE,
    'stack/joint_states': joint_state.TYPE,
    'truth/surface': point_cloud.TYPE,
    'truth/description': diagnostics.TYPE,
}


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
    for name, kind in TOPICS.items():
        writer.add_topic(ros_topic(f'/{name}', kind))
    travel = simulation.travel
    writer.write('/truth/surface', _true_surface(simulation), START)
    writer.write('/truth/description', _description(simulation).encode(), START)
    joints = list(zip(travel.joint_stamps, travel.joint_z, strict=True))
    for frame in simulation.frames():
        # A joint state is known when it is measured, a frame when it is exposed.
        while joints and joints[0][0] <= frame.stamp:
            _write_joint_state(writer, *joints.pop(0))
        stamp = START + frame.stamp
        writer.write('/stack/image', image.encode_image(Header.at(stamp, FRAME), frame.image), stamp)
        done(frame.index + 1)
    for stamp, z in joints:
        _write_joint_state(writer, stamp, z)


def node_parameters(simulation: Simulation) -> dict[str, RosValue]:
    """The parameters with which the node measures this stack, in metres."""
    pitch_x, pitch_y = _pitch(simulation)
    return {
        'stack.pitch_x': pitch_x,
        'stack.pitch_y': pitch_y,
        'stack.z_source': 'joint_states',
        'stack.joint': JOINT,
        'stack.frames': len(simulation),
    }


def _pitch(simulation: Simulation) -> tuple[float, float]:
    grid = simulation.specimen.grid
    return round(grid.dx * 1e-6, 15), round(grid.dy * 1e-6, 15)


def _write_joint_state(writer: RecordingWriter, stamp: np.int64, z: np.float64) -> None:
    at = START + int(stamp)
    state = joint_state.JointState(Header.at(at, ''), [JOINT], [float(z) * 1e-6])
    writer.write('/stack/joint_states', state.encode(), at)


def _true_surface(simulation: Simulation) -> bytes:
    truth = simulation.truth
    pitch_x, pitch_y = _pitch(simulation)
    rows, columns = np.indices(truth.depth.shape)
    xyz = np.dstack([columns * pitch_x, rows * pitch_y, truth.depth * 1e-6])
    return point_cloud.encode_point_cloud(Header.at(START, FRAME), xyz, {'cause': truth.cause})


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
        diagnostics.OK, 'simulation', 'What the simulated stack was made with.', FRAME, values
    )
