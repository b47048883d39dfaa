# SPDX-License-Identifier: Apache-2.0
"""The candidates of the benchmark: the filter's steps, and their counterparts in other libraries (peers).

All candidates work on the same points. Peers run in the way that is fastest for them, and are timed without
steps that only this comparison needs, such as converting the cloud.
"""

import importlib
import importlib.util
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from socialcircle_ros.baselines import peers, radius_filter, statistical_filter
from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.circle.expansion import divide
from socialcircle_ros.circle.radius import circle_limit
from socialcircle_ros.circle.region import choose_region
from socialcircle_ros.circle.seed import elect_seed
from socialcircle_ros.cloud import Cloud, Mask
from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import TYPE, encode_point_cloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.settings import CircleSettings, PipelineSettings
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.studies.timing import elapsed_ms

ROWS, COLUMNS = 960, 1280
SHARE = 0.1
"""Share of outliers in the cloud."""

EXPANSION = 'expansion'
"""Includes the radius, which takes negligible time."""
VOTE, LARGE_VOTE = 'vote 60×60', 'vote 200×200'
EXACT, ADAPTIVE, RULES = 'exact mode', 'adaptive mode', 'adaptive mode, rules'
RADIUS, STATISTICAL = 'radius baseline', 'statistical baseline'
COPY, FILTER = 'recording copied', 'recording filtered'
NUMPY, OPENCV, SCIPY = 'NumPy vote 60×60', 'OpenCV components', 'SciPy label'
PCL_STATISTICAL, PCL_RADIUS = 'PCL statistical', 'PCL radius'
OPEN3D_STATISTICAL, OPEN3D_RADIUS = 'Open3D statistical', 'Open3D radius'

_RECORDED = 6
"""Clouds in the recording that is filtered: 120 MB."""
_EIGHT_NEIGHBOURS = np.ones((3, 3), int)


@dataclass(frozen=True)
class Candidate:
    """Something that is timed.

    Attributes:
        name: what it is.
        threads: how many it may use; None: the peer decides.
        run: runs it once, and returns the time in ms.
        is_peer: whether it is another library's.
    """

    name: str
    threads: int | None
    run: Callable[[], float]
    is_peer: bool = False

    @property
    def label(self) -> str:
        """Name and number of threads."""
        words = {None: 'threads of its own choice', 1: '1 thread'}
        return f'{self.name}, {words.get(self.threads, f"{self.threads} threads")}'


@contextmanager
def all_candidates() -> Iterator[list[Candidate]]:
    """All candidates that can run here, on one simulated 1280×960 float32 cloud, while the `with` block lasts."""
    xyz = make_scene('metal_groove', ROWS, COLUMNS, share=SHARE).points
    thread_counts = sorted({1, usable_cores()})
    with tempfile.TemporaryDirectory() as folder:
        runs = _filter_runs(xyz) | _recording_runs(xyz, Path(folder))
        own = [
            Candidate(name, count, partial(_with_threads, count, run))
            for name, run in runs.items()
            for count in thread_counts
        ]
        yield own + _peer_candidates(xyz, thread_counts)


def missing_peers() -> list[str]:
    """The peers that are not installed."""
    installed = {
        'PCL (pcl_outlier_removal)': peers.pcl_is_installed(),
        'Open3D': peers.open3d_is_installed(),
        'OpenCV': _is_installed('cv2'),
        'SciPy': _is_installed('scipy'),
    }
    return [name for name, is_installed in installed.items() if not is_installed]


def _filter_runs(xyz: Cloud) -> dict[str, Callable[[], float]]:
    """The filter's steps and modes, and the baselines."""
    seed = elect_seed(xyz, None)
    region = choose_region(xyz)
    large = (min(region[0], ROWS - 200), min(region[1], COLUMNS - 200), 200, 200)
    exact = CircleSettings(mode='paper')
    calls: dict[str, Callable[[], object]] = {
        EXPANSION: partial(_expand, xyz, seed),
        VOTE: partial(elect_seed, xyz, region),
        LARGE_VOTE: partial(elect_seed, xyz, large),
        EXACT: partial(remove_outliers, xyz, exact),
        **{
            f'{EXACT}, window {window}': partial(remove_outliers, xyz, replace(exact, window=window))
            for window in (5, 7)
        },
        ADAPTIVE: partial(remove_outliers, xyz, CircleSettings(mode='adaptive')),
        RULES: partial(remove_outliers, xyz, CircleSettings(mode='adaptive', judge='rules')),
        RADIUS: partial(radius_filter, xyz),
        STATISTICAL: partial(statistical_filter, xyz),
    }
    return {name: partial(elapsed_ms, call) for name, call in calls.items()}


def _expand(xyz: Cloud, seed: tuple[int, int]) -> tuple[Mask, Mask]:
    """Radius and expansion from a given seed: masks of the inliers and of the outliers."""
    return divide(xyz, seed, circle_limit(xyz, seed, 3, None, 1.0), 3)


def _recording_runs(xyz: Cloud, folder: Path) -> dict[str, Callable[[], float]]:
    """Copying and filtering a recording."""
    source, target = folder / 'source.mcap', folder / 'target.mcap'
    _record(source, xyz)
    exact = PipelineSettings(circle=CircleSettings(mode='paper'))
    return {
        COPY: partial(_into_new, target, partial(_copy, source, target)),
        FILTER: partial(_into_new, target, partial(filter_recording, source, target, exact)),
    }


def _peer_candidates(xyz: Cloud, thread_counts: list[int]) -> list[Candidate]:
    """The peers that are installed; NumPy's vote always is."""
    top, left, height, width = choose_region(xyz)
    region = xyz[top : top + height, left : left + width].astype(np.float64)
    voters = region[np.isfinite(region).all(axis=2)]
    found = [Candidate(NUMPY, 1, partial(elapsed_ms, partial(numpy_vote, voters)), is_peer=True)]
    found += _labelling_candidates(_expand(xyz, elect_seed(xyz, None))[0], thread_counts)
    filters: dict[str, Callable[[Cloud], peers.PeerResult]] = {}
    if peers.pcl_is_installed():
        filters |= {PCL_STATISTICAL: peers.pcl_statistical_filter, PCL_RADIUS: peers.pcl_radius_filter}
    if peers.open3d_is_installed():
        filters |= {OPEN3D_STATISTICAL: peers.open3d_statistical_filter, OPEN3D_RADIUS: peers.open3d_radius_filter}
    return found + [
        Candidate(name, None, partial(_reported_ms, run, xyz), is_peer=True) for name, run in filters.items()
    ]


def _labelling_candidates(inliers: Mask, thread_counts: list[int]) -> list[Candidate]:
    """OpenCV's and SciPy's connected components of the inliers, 8-connected."""
    found = []
    components = inliers.view(np.uint8)
    if _is_installed('cv2'):
        cv2 = importlib.import_module('cv2')

        def label(count: int) -> None:
            cv2.setNumThreads(count)
            cv2.connectedComponents(components, connectivity=8, ltype=cv2.CV_32S)

        found += [
            Candidate(OPENCV, count, partial(elapsed_ms, partial(label, count)), is_peer=True)
            for count in thread_counts
        ]
    if _is_installed('scipy'):
        ndimage = importlib.import_module('scipy.ndimage')
        label_scipy = partial(ndimage.label, components, structure=_EIGHT_NEIGHBOURS)
        found.append(Candidate(SCIPY, 1, partial(elapsed_ms, label_scipy), is_peer=True))
    return found


def _reported_ms(run: Callable[[Cloud], peers.PeerResult], xyz: Cloud) -> float:
    """The time that the peer itself reports."""
    return run(xyz).milliseconds


def _with_threads(count: int, run: Callable[[], float]) -> float:
    """Run with a limit on this package's threads."""
    before, bands.limit = bands.limit, count
    try:
        return run()
    finally:
        bands.limit = before


def _is_installed(module: str) -> bool:
    return importlib.util.find_spec(module) is not None


def numpy_vote(points: npt.NDArray[np.float64]) -> int:
    """Eq. 4 and 5 by broadcasting.

    Args:
        points: (n, 3).

    Returns:
        Index of the elected point.
    """
    squares = np.zeros((len(points), len(points)))
    for coordinate in points.T:
        squares += (coordinate[:, None] - coordinate) ** 2
    distances = np.sqrt(squares)
    others = distances[~np.eye(len(points), dtype=bool)].reshape(len(points), -1)
    votes = np.exp(-((distances / np.median(others, axis=1)[:, None]) ** 2) / 2) / np.sqrt(2 * np.pi)
    np.fill_diagonal(votes, 0)
    return int(votes.sum(axis=0).argmax())


def _record(path: Path, xyz: Cloud) -> None:
    """Write a recording of clouds of 16 bytes per point."""
    message = encode_point_cloud(Header(), xyz, {'intensity': xyz[..., 2]})
    with RecordingWriter(path) as writer:
        writer.add_topic(ros_topic('/points', TYPE))
        for number in range(_RECORDED):
            writer.write('/points', message, number * 100_000_000)


def _into_new(target: Path, call: Callable[[], object]) -> float:
    """Time of a call that makes a file, in ms, without removing the previous file."""
    target.unlink(missing_ok=True)
    return elapsed_ms(call)


def _copy(source: Path, target: Path) -> None:
    """Read and write a recording, message by message."""
    with open_recording(source) as reader, RecordingWriter(target) as writer:
        for topic in reader.topics.values():
            writer.add_topic(topic)
        for message in reader.messages():
            writer.write(*message)
