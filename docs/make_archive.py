# SPDX-License-Identifier: Apache-2.0
"""Makes the archive of docs/archives.md: 100 recordings of three cells, always with the same bytes.

    python docs/make_archive.py nights

Each recording holds ten clouds of a simulated part. In cell3 the heights drift from recording 12 on, by 1.5 % per
recording, as with a tool that wears. One recording of cell2 is damaged: its file is cut off in the middle.
"""

import sys
from pathlib import Path

import numpy as np

from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.recording.units import with_unit
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.storage import write_file

START = 1_788_220_800_000_000_000  # ns; 2026-09-01
PERIOD = 6 * 3600 * 1_000_000_000  # ns between two recordings of a cell
TAKT = 30_000_000_000  # ns between two clouds
CLOUDS = 10
RECORDINGS = {'cell1': 34, 'cell2': 33, 'cell3': 33}
DRIFTS_FROM, DRIFT = 12, 0.015
DAMAGED = 'cell2', 17


def main(folder: Path) -> None:
    """Write all recordings."""
    for number, (cell, count) in enumerate(RECORDINGS.items()):
        for night in range(count):
            path = folder / cell / f'lid_{night:03d}.mcap'
            path.parent.mkdir(parents=True, exist_ok=True)
            drift = 1 + DRIFT * max(0, night - DRIFTS_FROM) if cell == 'cell3' else 1.0
            write(path, START + night * PERIOD, seed=1000 * number + CLOUDS * night, drift=drift)
            if (cell, night) == DAMAGED:
                content = path.read_bytes()
                write_file(path, content[: len(content) // 2])


def write(path: Path, start: int, *, seed: int, drift: float) -> None:
    """Write one recording; `drift` is a factor on the heights."""
    with RecordingWriter(path, overwrite=True) as writer:
        writer.add_topic(with_unit(ros_topic('/points', point_cloud.TYPE), 'um'))
        for number in range(CLOUDS):
            time = start + number * TAKT
            share = float(np.random.default_rng(seed + number).normal(0.02, 0.002))
            scene = make_scene('metal_groove', 90, 120, seed=seed + number, share=share)
            points = scene.points.copy()
            points[..., 2] *= drift
            writer.write('/points', point_cloud.encode_point_cloud(Header.at(time, 'microscope'), points), time)


if __name__ == '__main__':
    main(Path(sys.argv[1]))
