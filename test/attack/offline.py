# SPDX-License-Identifier: Apache-2.0
"""Attacks on the code of the node and of the commands within this process.

Each one compares good input after the attack with the same input in a clean run.
"""

import shutil
from functools import partial
from random import Random

import numpy as np
from attack.generators import (
    damaged,
    good_stack,
    hostile_cloud,
    hostile_frame,
    hostile_joint_state,
    hostile_parameter,
    write_recording,
)
from attack.tally import Tally
from examples import cloud

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.interface import FILTERED, MASK
from socialcircle_ros.messages.image import OUTLIER, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.stack_cloud import StackCloud
from socialcircle_ros.pipeline.stacks import Refusal, StackAssembler
from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.offline import clouds_of, filter_recording
from socialcircle_ros.settings import (
    CircleSettings,
    FocusSettings,
    OutputSettings,
    PipelineSettings,
    StackSettings,
)

EVERYTHING = OutputSettings(mask=True, score=True, repaired=True)


def attack_clouds(random: Random, count: int) -> Tally:
    """Hostile clouds through the whole pipeline, in both modes and with every output."""
    tally = Tally('clouds, in process')
    settings = [
        PipelineSettings(circle=CircleSettings(mode=mode), output=EVERYTHING) for mode in ('paper', 'adaptive')
    ]
    good = cloud(30, 40)
    clean = [filter_cloud(good, each).messages for each in settings]
    for number in range(count):
        message, which = hostile_cloud(random), number % 2
        tally.tried += 1
        try:
            messages = filter_cloud(message, settings[which]).messages
        except SocialCircleError as error:
            if not str(error):
                tally.tell('a refusal without a sentence')
                continue
        except Exception as error:  # noqa: BLE001 - this is what is looked for
            tally.tell(f'cloud {number}: {error!r}')
            continue
        else:
            if not only_outliers_changed(message, messages):
                tally.wrong += 1
                tally.tell(f'cloud {number}: a kept point is not the input')
        tally.survived += 1
        if number % 10 < 2:
            check_good_cloud(tally, good, settings[which], clean[which])
    return tally


def check_good_cloud(tally, good, settings, clean):
    try:
        if filter_cloud(good, settings).messages != clean:
            tally.wrong += 1
            tally.tell('a good cloud gives other bytes than before')
    except SocialCircleError as error:
        tally.lost += 1
        tally.tell(f'a good cloud is refused: {error}')


def only_outliers_changed(message: bytes, messages) -> bool:
    """Whether the filtered cloud is the input with NaN for its outliers."""
    before, after = PointCloud.decode(message).xyz(), PointCloud.decode(messages[FILTERED]).xyz()
    outliers = decode_mono8(messages[MASK]) == OUTLIER
    same = np.array_equal(before[~outliers], after[~outliers], equal_nan=True)
    return same and bool(np.isnan(after[outliers]).all())


def attack_stacks(random: Random, count: int) -> Tally:
    """Hostile frames and joint states between stacks, and refused ones within stacks."""
    tally = Tally('frames and joint states, in process')
    for z_source in ('step', 'joint_states'):
        settings = StackSettings(pitch_x=2e-6, z_step=1e-6, frames=9, z_source=z_source, max_pixels=10_000)
        made, clean = StackAssembler(), StackAssembler()
        for each in (made, clean):
            each.configure(FocusSettings(), settings)
        wanted = clouds_in(measure(clean))
        for _ in range(count // 20):
            for _ in range(8):
                add_hostile(random, made, tally, refused_only=False)
            list(made.finish())
            check_told(tally, wanted, [*measure(made), *made.finish()])
            compare_stack(tally, wanted, measure(made))
            compare_stack(
                tally, wanted, measure(made, partial(add_hostile, random, made, tally, refused_only=True))
            )
    return tally


def measure(made, between=lambda: None):
    """The events of one good stack."""
    events = []
    for number, (state, frame) in enumerate(good_stack()):
        events += [*made.add_joint_state(state), *made.add_frame(frame)]
        if number % 4 == 1:
            between()
    return events


def clouds_in(events):
    return [(event.points, event.image) for event in events if isinstance(event, StackCloud)]


def compare_stack(tally, wanted, events):
    found = clouds_in(events)
    if not found:
        tally.lost += 1
        tally.tell(f'a good stack gave no cloud: {events}')
    elif found != wanted:
        tally.wrong += 1
        tally.tell('a good stack gives another cloud than before')


def check_told(tally, wanted, events):
    """A stack after valid frames of another time is the same as before, or the events say that it is not."""
    told = any(isinstance(event, Refusal) or event.warning for event in events)
    if not told:
        compare_stack(tally, wanted, events)


def add_hostile(random, made, tally, *, refused_only):
    """Add a hostile frame or joint state; with `refused_only` one that a fresh assembler refuses."""
    is_frame = random.random() < 0.6
    message = (hostile_frame if is_frame else hostile_joint_state)(random)
    tally.tried += 1
    try:
        if refused_only and not refused_by_a_fresh(made, message, is_frame=is_frame):
            tally.survived += 1
            return
        list(made.add_frame(message) if is_frame else made.add_joint_state(message))
    except Exception as error:  # noqa: BLE001 - this is what is looked for
        tally.tell(f'{"frame" if is_frame else "joint state"}: {error!r}')
        return
    tally.survived += 1


def refused_by_a_fresh(made, message, *, is_frame):
    fresh = StackAssembler()
    fresh.configure(made._focus, made._settings)
    events = list(fresh.add_frame(message) if is_frame else fresh.add_joint_state(message))
    return bool(events) and all(isinstance(event, Refusal) for event in events)


def attack_settings(random: Random, count: int) -> Tally:
    """Parameters as a parameter file or a graph sets them: allowed, or refused with a sentence."""
    tally = Tally('parameters, in process')
    clean = filter_cloud(cloud(30, 40)).messages
    for _ in range(count):
        name, value = hostile_parameter(random)
        tally.tried += 1
        try:
            settings = PipelineSettings.from_ros({name: value})
            filter_cloud(cloud(12, 14), settings)
        except SocialCircleError:
            pass
        except Exception as error:  # noqa: BLE001 - this is what is looked for
            tally.tell(f'{name} = {value!r}: {error!r}')
            continue
        tally.survived += 1
    check_good_cloud(tally, cloud(30, 40), PipelineSettings(), clean)
    return tally


def attack_recordings(random: Random, count: int, folder) -> Tally:
    """Damaged recordings through `filter_recording`: what can be read is filtered as before, and no rest stays."""
    tally = Tally('damaged recordings')
    originals = [cloud(20, 24, seed=seed, stamp=10**9 * (seed + 1)) for seed in range(4)]
    answers = {message: filter_cloud(message).messages[FILTERED] for message in originals}
    for name in ('intact.mcap', 'intact'):
        write_recording(folder / name, originals)
    for number in range(count):
        work = folder / f'run{number}'
        work.mkdir()
        source, target = damage_recording(random, folder / ('intact.mcap' if number % 2 else 'intact'), work)
        tally.tried += 1
        try:
            filter_one(tally, source, target, answers)
        except SocialCircleError:
            if target.exists():
                tally.wrong += 1
                tally.tell(f'recording {number}: a refused run left {target.name}')
        except Exception as error:  # noqa: BLE001 - this is what is looked for
            tally.tell(f'recording {number}: {error!r}')
            continue
        left = {path.name for path in work.iterdir()} - {source.name, target.name}
        if left:
            tally.wrong += 1
            tally.tell(f'recording {number}: left behind: {left}')
        tally.survived += 1
        shutil.rmtree(work)
    return tally


def damage_recording(random, intact, work):
    """A damaged copy of a recording, and where its filtered one goes."""
    source = work / intact.name
    if intact.is_dir():
        shutil.copytree(intact, source)
        victim = random.choice(sorted(source.iterdir()))
    else:
        shutil.copy(intact, source)
        victim = source
    victim.write_bytes(damaged(random, victim.read_bytes()))
    return source, work / 'cleaned.mcap'


def filter_one(tally, source, target, answers):
    """Filter a recording, and compare each original cloud that it still holds.

    Raises:
        SocialCircleError: the recording is refused.
    """
    summary = filter_recording(source, target, PipelineSettings())
    with open_recording(source) as reader:
        topics = clouds_of(reader)
        read = [message.data for message in reader.messages(topics)] if topics else []
    with open_recording(target) as reader:
        kept = {bytes(message.data) for message in reader.messages()}
    for data in read:
        answer = answers.get(bytes(data))
        if answer is not None and answer not in kept:
            tally.lost += 1
            tally.tell(f'{source}: a cloud that can be read gave no result or a wrong one: {summary}')
