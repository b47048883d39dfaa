# SPDX-License-Identifier: Apache-2.0
"""The filters of PCL and Open3D on the same points, for comparison.

They search a k-d tree, not a window. Their masks therefore differ from ours where the nearest neighbours of a
point lie outside of its window. Both are optional: PCL runs through its command line tools (Debian's pcl-tools),
Open3D through its Python package. Each receives the measured points only.
"""

import importlib
import importlib.util
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from socialcircle_ros.arguments import settings_or_default
from socialcircle_ros.cloud import Cloud, Mask, measured_points, organized
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.kernels.compiled import kernel

from .radius import radius_of
from .result import FilterResult
from .settings import RadiusSettings, StatisticalSettings

_FILTER, _CONVERTER = 'pcl_outlier_removal', 'pcl_convert_pcd_ascii_binary'


@dataclass(frozen=True, eq=False)
class PeerResult(FilterResult):
    """The result of a filter of another library, without a score.

    Attributes:
        milliseconds: time of the filter itself, as it or its caller measured it, without the conversion of the
            cloud and without reading and writing files.
    """

    milliseconds: float


class _Open3DCloud(Protocol):
    """What is used of open3d.geometry.PointCloud."""

    def remove_radius_outlier(self, nb_points: int, radius: float) -> tuple[object, list[int]]:
        """Keep points with more than `nb_points` points in the sphere, the point itself counted."""

    def remove_statistical_outlier(self, nb_neighbors: int, std_ratio: float) -> tuple[object, list[int]]:
        """Keep points by their mean distance to `nb_neighbors` points, the point itself counted."""


def pcl_is_installed() -> bool:
    """Whether PCL's command line tools are on the path."""
    return shutil.which(_FILTER) is not None and shutil.which(_CONVERTER) is not None


def open3d_is_installed() -> bool:
    """Whether the Python package open3d is installed."""
    return importlib.util.find_spec('open3d') is not None


def pcl_radius_filter(xyz: npt.ArrayLike, settings: RadiusSettings | None = None) -> PeerResult:
    """Run `radius_filter` of PCL, in float32, without a window.

    Raises:
        CloudError: as radius_filter.
        SocialCircleError: PCL's tools are not installed, or gave no result.
    """
    settings = settings_or_default(RadiusSettings, settings)
    cloud = organized(xyz)
    radius, fewest = repr(radius_of(cloud, settings)), str(settings.min_neighbours)
    return _run_pcl(cloud, '-method', 'radius', '-radius', radius, '-min_pts', fewest)


def pcl_statistical_filter(xyz: npt.ArrayLike, settings: StatisticalSettings | None = None) -> PeerResult:
    """Run `statistical_filter` of PCL, in float32, without a window.

    Raises:
        CloudError: as statistical_filter.
        SocialCircleError: PCL's tools are not installed, or gave no result.
    """
    settings = settings_or_default(StatisticalSettings, settings)
    count, factor = str(settings.neighbours), repr(settings.std_factor)
    return _run_pcl(organized(xyz), '-method', 'statistical', '-mean_k', count, '-std_dev_mul', factor)


def open3d_radius_filter(xyz: npt.ArrayLike, settings: RadiusSettings | None = None) -> PeerResult:
    """Run `radius_filter` of Open3D, without a window.

    Raises:
        CloudError: as radius_filter.
        SocialCircleError: Open3D is not installed.
    """
    settings = settings_or_default(RadiusSettings, settings)
    cloud = organized(xyz)
    radius = radius_of(cloud, settings)
    # Open3D keeps a point with more than nb_points in the sphere and counts the point itself: the same as ours.
    return _run_open3d(cloud, lambda points: points.remove_radius_outlier(settings.min_neighbours, radius))


def open3d_statistical_filter(xyz: npt.ArrayLike, settings: StatisticalSettings | None = None) -> PeerResult:
    """Run `statistical_filter` of Open3D, without a window.

    Raises:
        CloudError: as statistical_filter.
        SocialCircleError: Open3D is not installed.
    """
    settings = settings_or_default(StatisticalSettings, settings)
    # Open3D counts the point itself as a neighbour at distance 0: with one more it is the same filter.
    count = settings.neighbours + 1
    return _run_open3d(
        organized(xyz), lambda points: points.remove_statistical_outlier(count, settings.std_factor)
    )


def _run_open3d(cloud: Cloud, remove: Callable[[_Open3DCloud], tuple[object, list[int]]]) -> PeerResult:
    if not open3d_is_installed():
        raise SocialCircleError(
            'Open3D is not installed; install it with `pip install open3d`, or leave Open3D out of the comparison.'
        )
    open3d = importlib.import_module('open3d')
    measured = measured_points(cloud)
    points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud[measured].astype(np.float64)))
    start = time.perf_counter()
    _, kept = remove(points)
    milliseconds = (time.perf_counter() - start) * 1e3
    is_kept = np.zeros(int(measured.sum()), np.bool_)
    is_kept[np.asarray(kept, np.int64)] = True
    return _on_grid(measured, is_kept, milliseconds)


def _run_pcl(cloud: Cloud, *options: str) -> PeerResult:
    tool, converter = shutil.which(_FILTER), shutil.which(_CONVERTER)
    if tool is None or converter is None:
        raise SocialCircleError(
            "PCL's command line tools are not installed; install Debian's pcl-tools, or leave PCL out of the"
            ' comparison.'
        )
    measured = measured_points(cloud)
    points = cloud[measured].astype('<f4')
    with tempfile.TemporaryDirectory() as folder:
        given, packed, plain = (str(Path(folder) / name) for name in ('given.pcd', 'packed.pcd', 'plain.pcd'))
        # Unorganized: for an organized cloud the tool searches no k-d tree, and it fails on a NaN.
        header = (
            'VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n'
            f'WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA binary\n'
        )
        Path(given).write_bytes(header.encode() + points.tobytes())
        said = _run(tool, given, packed, *options)
        took = re.search(r'Computing filtered cloud.*?done, ([\d.e+]+) ms', said, re.DOTALL)
        # The tool always writes a compressed file.
        _run(converter, packed, plain, '1')
        if took is None or not Path(plain).exists():
            raise SocialCircleError(
                f"PCL's {_FILTER} gave no result; its output ends with: {said.strip()[-300:]!r}."
            )
        written, _, data = Path(plain).read_bytes().partition(b'DATA binary\n')
    count = int(written.partition(b'POINTS ')[2])
    kept = np.frombuffer(data, '<f4', 3 * count).reshape(-1, 3)  # the file is longer than its points
    return _on_grid(measured, _find_kept(points, kept), float(took[1]))


def _run(*command: str) -> str:
    """Run a tool and return its output without colour codes."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - found on the path
    return re.sub(r'\x1b\[[\d;]*m', '', done.stdout + done.stderr)


@kernel
def _find_kept(points: Cloud, kept: Cloud) -> Mask:
    """Which of `points`, (N, 3), are among `kept`, (M, 3); both have the same order."""
    found = np.zeros(len(points), np.bool_)
    following = 0
    for point in range(len(points)):
        if following < len(kept) and (points[point] == kept[following]).all():
            found[point] = True
            following += 1
    return found


def _on_grid(measured: Mask, is_kept: Mask, milliseconds: float) -> PeerResult:
    inliers = np.zeros(measured.shape, np.bool_)
    inliers[measured] = is_kept
    return PeerResult(inliers, measured & ~inliers, None, None, milliseconds)
