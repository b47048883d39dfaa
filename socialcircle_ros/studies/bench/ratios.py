"""Our speed as ratios: our steps and the peers that are installed, taking turns on the same points.

A ratio of one run says more than two times: the machine's moods meet all alike. Peers are asked in the way that
is fastest for them, and timed without what only this comparison needs, such as converting the cloud.
"""

import importlib
import importlib.util
import itertools
import math
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from socialcircle_ros.baselines import peers, radius_filter, statistical_filter
from socialcircle_ros.circle import remove_outliers
from socialcircle_ros.circle.expansion import divide
from socialcircle_ros.circle.radius import circle_limit
from socialcircle_ros.circle.seed import choose_region, elect_seed
from socialcircle_ros.kernels import bands
from socialcircle_ros.kernels.machine import usable_cores
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import TYPE, encode_point_cloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.settings import CircleSettings, PipelineSettings
from socialcircle_ros.simulation import make_scene

ROWS, COLUMNS = 960, 1280
SHARE = 0.1
"""Of outliers in the cloud."""
FEW = 5
"""So often a peer runs that takes longer than `LONG`."""
LONG = 300.0
"""ms."""
_CLOUDS = 6
"""In the recording that is filtered: 120 MB."""


@dataclass(frozen=True)
class Candidate:
    """Something to be timed.

    Attributes:
        name: what it is.
        threads: how many it may use; None: it decides.
        call: does it once; gives the ms that it took, or None for all of the call.
        is_peer: whether it is somebody else's.
    """

    name: str
    threads: int | None
    call: Callable[[], float | None]
    is_peer: bool = False

    @property
    def label(self) -> str:
        """Name and number of threads."""
        words = {None: 'threads of its own choice', 1: '1 thread'}
        return f'{self.name}, {words.get(self.threads, f"{self.threads} threads")}'


@dataclass(frozen=True)
class Figure:
    """What was measured of a candidate.

    Attributes:
        milliseconds: the median.
        repeats: of so many times, after one that does not count.
    """

    name: str
    threads: int | None
    is_peer: bool
    milliseconds: float
    repeats: int


@dataclass(frozen=True)
class RatioGoal:
    """A ratio of two candidates and its bound.

    Attributes:
        numerator: name of a candidate.
        denominator: name of another; '' for a millisecond.
        sense: on which side of the bound the ratio should be.
        bound: see there.
    """

    numerator: str
    denominator: str
    sense: Literal['at most', 'at least']
    bound: float

    def holds(self, ratio: float) -> bool:
        """Whether the ratio is on the right side."""
        return ratio <= self.bound if self.sense == 'at most' else ratio >= self.bound


_EXPANSION = 'expansion'  # and the radius, which takes no time
_SEED, _LARGE_SEED, _WHOLE = 'vote 60×60', 'vote 200×200', 'exact mode'
_ADAPTIVE = 'adaptive mode'
_NUMPY, _OPENCV, _SCIPY = 'NumPy vote 60×60', 'OpenCV components', 'SciPy label'
_COPY, _FILTER = 'recording copied', 'recording filtered'

GOALS = (
    RatioGoal(_EXPANSION, _OPENCV, 'at most', 1.5),
    RatioGoal('PCL statistical', _EXPANSION, 'at least', 200),
    RatioGoal(_NUMPY, _SEED, 'at least', 100),
    RatioGoal(_LARGE_SEED, '', 'at most', 60),
    *(
        RatioGoal(f'{owner} {kind}', _WHOLE, 'at least', 100)
        for owner in ('PCL', 'Open3D')
        for kind in ('statistical', 'radius')
    ),
    RatioGoal(f'{_WHOLE}, window 5', _WHOLE, 'at most', 3),
    RatioGoal(f'{_WHOLE}, window 7', _WHOLE, 'at most', 3),
    RatioGoal('PCL statistical', _ADAPTIVE, 'at least', 10),
    RatioGoal('PCL radius', 'radius baseline', 'at least', 20),
    RatioGoal('PCL statistical', 'statistical baseline', 'at least', 20),
    RatioGoal(_FILTER, _COPY, 'at most', 1.5),
)


@dataclass(frozen=True)
class Ratio:
    """A goal, and what was measured with so many threads on our side."""

    goal: RatioGoal
    threads: int
    ratio: float

    @property
    def holds(self) -> bool:
        """Whether the goal is reached."""
        return self.goal.holds(self.ratio)


def benchmark(candidates: list[Candidate], repeats: int, seen: Callable[[str], None]) -> list[Figure]:
    """Time all, taking turns.

    Args:
        candidates: who.
        repeats: how often, after a first time that does not count; `FEW` for the slow.
        seen: called with what begins.
    """
    for each in candidates:
        seen(f'{each.label}: first time')
        each.call()
    times: dict[Candidate, list[float]] = {each: [] for each in candidates}
    for turn, each in itertools.product(range(repeats), candidates):
        taken = times[each]
        slow = each.is_peer and turn > 0 and taken[0] > LONG
        if not slow or turn * FEW // repeats >= len(taken):
            seen(f'turn {turn + 1} of {repeats}: {each.label}')
            taken.append(_took(each.call))
    return [
        Figure(each.name, each.threads, each.is_peer, statistics.median(taken), len(taken))
        for each, taken in times.items()
    ]


def ratios(figures: list[Figure]) -> list[Ratio]:
    """The goals of which both sides were measured, for each number of our threads.

    A peer counts with its fastest figure.
    """
    fastest = {'': 1.0}
    ours: dict[tuple[str, int], float] = {}
    for figure in figures:
        if figure.is_peer:
            fastest[figure.name] = min(fastest.get(figure.name, math.inf), figure.milliseconds)
        elif figure.threads is not None:
            ours[figure.name, figure.threads] = figure.milliseconds
    found = []
    for goal, count in itertools.product(GOALS, sorted({count for _, count in ours})):
        above, below = (ours.get((name, count), fastest.get(name)) for name in (goal.numerator, goal.denominator))
        if above is not None and below is not None:
            found.append(Ratio(goal, count, above / below))
    return found


def missing_peers() -> list[str]:
    """The peers that are not installed, and so left out."""
    there = {
        'PCL (pcl_outlier_removal)': peers.pcl_is_installed(),
        'Open3D': peers.open3d_is_installed(),
        'OpenCV': _is_installed('cv2'),
        'SciPy': _is_installed('scipy'),
    }
    return [name for name, is_there in there.items() if not is_there]


@contextmanager
def all_candidates() -> Iterator[list[Candidate]]:
    """All who can run here, on one simulated cloud of 1280×960 float32, while the `with` block lasts."""
    xyz = make_scene('metal_groove', ROWS, COLUMNS, share=SHARE).points
    seed = elect_seed(xyz, None)
    inliers = divide(xyz, seed, circle_limit(xyz, seed, 3, None, 1.0), 3)[0]
    top, left, height, width = choose_region(xyz)
    region = xyz[top : top + height, left : left + width].astype(np.float64)
    large = (min(top, ROWS - 200), min(left, COLUMNS - 200), 200, 200)
    calls: dict[str, Callable[[], float | None]] = {
        _EXPANSION: _timed(lambda: divide(xyz, seed, circle_limit(xyz, seed, 3, None, 1.0), 3)),
        _SEED: _timed(lambda: elect_seed(xyz, (top, left, height, width))),
        _LARGE_SEED: _timed(lambda: elect_seed(xyz, large)),
        _WHOLE: _timed(lambda: remove_outliers(xyz)),
        **{
            f'{_WHOLE}, window {window}': _timed(partial(remove_outliers, xyz, CircleSettings(window=window)))
            for window in (5, 7)
        },
        _ADAPTIVE: _timed(lambda: remove_outliers(xyz, CircleSettings(mode='adaptive'))),
        'radius baseline': _timed(lambda: radius_filter(xyz)),
        'statistical baseline': _timed(lambda: statistical_filter(xyz)),
    }
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / 'source.mcap', Path(folder) / 'target.mcap'
        _record(source, xyz)
        calls[_COPY] = partial(_into_new, target, lambda: _copy(source, target))
        calls[_FILTER] = partial(_into_new, target, lambda: filter_recording(source, target, PipelineSettings()))
        counts = sorted({1, usable_cores()})
        found = [
            Candidate(name, count, partial(_with_threads, count, call))
            for name, call in calls.items()
            for count in counts
        ]
        voters = region[np.isfinite(region).all(axis=2)]
        found.append(Candidate(_NUMPY, 1, _timed(lambda: _numpy_vote(voters)), is_peer=True))
        yield found + _peers(xyz, inliers, counts)


def _peers(xyz: Any, inliers: Any, counts: list[int]) -> list[Candidate]:
    found = []
    components = inliers.view(np.uint8)
    if _is_installed('cv2'):
        cv2 = importlib.import_module('cv2')

        def label(count: int) -> None:
            cv2.setNumThreads(count)
            cv2.connectedComponents(components, connectivity=8, ltype=cv2.CV_32S)

        found += [Candidate(_OPENCV, count, _timed(partial(label, count)), is_peer=True) for count in counts]
    if _is_installed('scipy'):
        ndimage = importlib.import_module('scipy.ndimage')
        eight = np.ones((3, 3), int)
        found.append(
            Candidate(_SCIPY, 1, _timed(lambda: ndimage.label(components, structure=eight)), is_peer=True)
        )
    filters: list[tuple[str, Callable[..., peers.PeerResult]]] = []
    if peers.pcl_is_installed():
        filters += [('PCL statistical', peers.pcl_statistical_filter), ('PCL radius', peers.pcl_radius_filter)]
    if peers.open3d_is_installed():
        filters += [
            ('Open3D statistical', peers.open3d_statistical_filter),
            ('Open3D radius', peers.open3d_radius_filter),
        ]
    return found + [Candidate(name, None, partial(_by_itself, call, xyz), is_peer=True) for name, call in filters]


def _by_itself(call: Callable[..., peers.PeerResult], xyz: Any) -> float:
    return call(xyz).milliseconds


def _timed(call: Callable[[], object]) -> Callable[[], None]:
    def run() -> None:
        call()

    return run


def _with_threads(count: int, call: Callable[[], float | None]) -> float | None:
    """Call with so many threads on our side."""
    before, bands.limit = bands.limit, count
    try:
        return call()
    finally:
        bands.limit = before


def _took(call: Callable[[], float | None]) -> float:
    began = time.perf_counter()
    own = call()
    return 1e3 * (time.perf_counter() - began) if own is None else own


def _is_installed(module: str) -> bool:
    return importlib.util.find_spec(module) is not None


def _numpy_vote(points: Any) -> int:
    """Eq. 4 and 5 by broadcasting: who wins among the points (n, 3)."""
    squares = np.zeros((len(points), len(points)))
    for coordinate in points.T:
        squares += (coordinate[:, None] - coordinate) ** 2
    distances = np.sqrt(squares)
    others = distances[~np.eye(len(points), dtype=bool)].reshape(len(points), -1)
    votes = np.exp(-((distances / np.median(others, axis=1)[:, None]) ** 2) / 2) / np.sqrt(2 * np.pi)
    np.fill_diagonal(votes, 0)
    return int(votes.sum(axis=0).argmax())


def _record(path: Path, xyz: Any) -> None:
    """A recording of clouds of 16 bytes a point."""
    message = encode_point_cloud(Header(), xyz, {'intensity': xyz[..., 2]})
    with RecordingWriter(path) as writer:
        writer.add_topic(ros_topic('/points', TYPE))
        for place in range(_CLOUDS):
            writer.write('/points', message, place * 100_000_000)


def _into_new(target: Path, call: Callable[[], object]) -> float:
    """The time of a call that makes a file, without that of removing the last one."""
    target.unlink(missing_ok=True)
    return _took(_timed(call))


def _copy(source: Path, target: Path) -> None:
    """Read and write a recording, message by message."""
    with open_recording(source) as reader, RecordingWriter(target) as writer:
        for topic in reader.topics.values():
            writer.add_topic(topic)
        for message in reader.messages():
            writer.write(*message)
