# SPDX-License-Identifier: Apache-2.0
"""Makes the recordings in this folder, always with the same bytes.

    python bags/make_bags.py

The clouds are simulated, so their outliers are known: each cloud on /points has its truth on
/truth/outlier_mask (0 surface, 255 outlier, 127 not measured or ambiguous). The stack has the true surface on
/truth/surface.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from socialcircle_ros.messages import image, point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.recording.simulated import pitch_of, write_simulation
from socialcircle_ros.recording.stacks import node_parameters
from socialcircle_ros.recording.units import with_unit
from socialcircle_ros.settings import yaml_text
from socialcircle_ros.simulation import Scene, Simulation, make_scene, simulate
from socialcircle_ros.storage import write_file

HERE = Path(__file__).resolve().parent
START = 1_700_000_000_000_000_000  # ns; an arbitrary fixed time
PERIOD = 500_000_000  # ns between two clouds
RESOLUTION = 1 / 64  # µm: heights are rounded to this, as instruments do; it halves the size of the files


def main() -> None:
    """Write all recordings."""
    write('metal_groove', [groove(0, 480, 640)])
    write('parts', [groove(seed, 120, 160) for seed in range(1, 9)])
    write('padded', [composite(seed) for seed in range(2)], padded=True)
    write_stack('stack', simulate('ball', 160, 200, seed=1))


def groove(seed: int, rows: int, columns: int) -> Scene:
    """A milled metal groove with isolated outliers and dense clusters of them, mostly on its walls."""
    return make_scene('metal_groove', rows, columns, seed=seed)


def composite(seed: int) -> Scene:
    """Woven fibres; the pitch along y is twice the pitch along x."""
    return make_scene('composite', 90, 120, seed=seed, pitch=(1.0, 2.0))


def write(name: str, scenes: list[Scene], *, padded: bool = False) -> None:
    """Write one recording with one cloud per scene; `padded` clouds have gaps, padding and more fields."""
    with RecordingWriter(HERE / f'{name}.mcap', compression='zstd', overwrite=True) as writer:
        writer.add_topic(with_unit(ros_topic('/points', point_cloud.TYPE), 'um'))
        writer.add_topic(ros_topic('/truth/outlier_mask', image.TYPE))
        for number, scene in enumerate(scenes):
            time = START + number * PERIOD
            header = Header.at(time, 'microscope')
            points = scene.points.copy()
            points[..., 2] = np.round(points[..., 2] / RESOLUTION) * RESOLUTION
            if padded:
                points[holes(points.shape[:2], number)] = np.nan
            measured = np.isfinite(points).all(axis=2)
            surface = measured & ~scene.outlier & ~scene.ambiguous
            truth = image.mask_pixels(surface, measured & scene.outlier)
            message = padded_cloud(header, points) if padded else point_cloud.encode_point_cloud(header, points)
            writer.write('/points', message, time)
            writer.write('/truth/outlier_mask', image.encode_image(header, truth), time)


def write_stack(name: str, simulation: Simulation) -> None:
    """Write a focus stack with joint states and truth, and the parameters that turn it into a cloud."""
    with RecordingWriter(HERE / f'{name}.mcap', compression='zstd', overwrite=True) as writer:
        write_simulation(simulation, writer)
    parameters = node_parameters(len(simulation), *pitch_of(simulation))
    write_file(HERE / f'{name}.yaml', yaml_text(parameters, whole=False))


def holes(shape: tuple[int, ...], seed: int) -> npt.NDArray[np.bool_]:
    """Points that are not measured, (H, W) bool: the first columns, and 2 % of all points at random."""
    mask = np.random.default_rng(seed).random(shape) < 0.02
    mask[:, : 3 + seed] = True
    return mask


def padded_cloud(header: Header, points: npt.NDArray[np.float32]) -> bytes:
    """A cloud with a layout that drivers use: more fields, gaps within a point, padding behind each row."""
    rows, columns = points.shape[:2]
    layout = np.dtype(
        {
            'names': ['intensity', 'x', 'y', 'z', 'quality', 'ring'],
            'formats': ['<f4', '<f4', '<f4', '<f4', '<f8', '<u2'],
            'offsets': [0, 4, 8, 12, 24, 34],
            'itemsize': 40,
        }
    )
    padding = 24
    rng = np.random.default_rng(rows)
    data = rng.integers(0, 256, (rows, columns * layout.itemsize + padding), np.uint8)
    grid = np.ndarray((rows, columns), layout, data, strides=(data.strides[0], layout.itemsize))
    for axis, field in enumerate('xyz'):
        grid[field] = points[..., axis]
    grid['intensity'] = np.nan_to_num(points[..., 2])
    grid['quality'] = rng.random((rows, columns))
    grid['ring'] = np.arange(rows)[:, None]
    return point_cloud.encode_layout(header, grid, data)


if __name__ == '__main__':
    main()
