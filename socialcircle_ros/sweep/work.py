# SPDX-License-Identifier: Apache-2.0
"""The task of a worker of a cluster: one setting in, one trial out. A worker reads the recording once."""

import json
import platform
import threading
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.settings import FocusSettings

from .clouds import CloudSource, SweptRecording, cached
from .search_space import ParameterValues
from .trials import Trial, fingerprint_of, run_trial

_reading = threading.Lock()


@dataclass(frozen=True)
class SweptClouds:
    """The clouds of a sweep, as a worker finds them; hashable.

    Attributes:
        recording: absolute path of the recording.
        parameters: all parameters as given, as JSON.
        varied: names of those that are varied.
        topics: names of the topics of clouds; empty: all topics named `points`, and all focus stacks.
        max_clouds: most clouds to filter.
        fingerprint: of the clouds, see `fingerprint_of`.
        lessons: the lesson files that trials use.
    """

    recording: str
    parameters: str
    varied: tuple[str, ...]
    topics: tuple[str, ...]
    max_clouds: int
    fingerprint: str
    lessons: tuple[str, ...] = ()


@dataclass(frozen=True)
class TrialTask:
    """One setting, and the clouds to filter with it."""

    clouds: SweptClouds
    values: ParameterValues


def do_trial(task: TrialTask) -> Trial:
    """Filter all clouds with one setting.

    Raises:
        SettingError: the values contradict each other.
        SocialCircleError: the recording cannot be read here, or it is another one than where the sweep began.
    """
    with _reading:  # threads of one worker share the clouds
        base, clouds = _read(task.clouds)
    return run_trial(base, task.values, clouds)


@lru_cache(maxsize=1)
def _read(clouds: SweptClouds) -> tuple[ParameterValues, CloudSource]:
    base = json.loads(clouds.parameters)
    load = cached(SweptRecording(Path(clouds.recording), base, clouds.topics, clouds.max_clouds).load)
    fixed = {name: value for name, value in base.items() if name not in clouds.varied}
    if fingerprint_of(load(FocusSettings.from_ros(base)), fixed, clouds.lessons) != clouds.fingerprint:
        lesson = ', or a lesson is another one,' if clouds.lessons else ''
        raise SocialCircleError(
            f'{clouds.recording} is another recording{lesson} on {platform.node()}: the workers must see the same'
            ' files under the same names.'
        )
    return base, load
