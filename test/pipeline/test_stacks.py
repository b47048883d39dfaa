# SPDX-License-Identifier: Apache-2.0
"""Frames and stage positions into clouds, without a node."""

import itertools

import numpy as np
import pytest
from focus.stacks import ruled
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated_drift import drifting_frames

from socialcircle_ros import FocusSettings, depth_from_focus
from socialcircle_ros.messages.cdr import CdrWriter
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import Image, encode_image
from socialcircle_ros.messages.joint_state import JointState
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.pipeline.stack_cloud import StackCloud
from socialcircle_ros.pipeline.stacks import MOST_STATES, MOST_WAITING, Refusal, StackAssembler
from socialcircle_ros.settings import StackSettings

PERIOD = 20_000_000  # ns between frames
STEP = 1e-6


def frames(count=9, shape=(24, 30), seed=0, dtype=np.uint8):
    """A textured plane that is sharpest in the middle; the mean light is that of all frames."""
    texture = np.random.default_rng(seed).integers(0, 200, shape)
    sharpness = np.exp(-(((np.arange(count) - (count - 1) / 2) / 2) ** 2))
    return [(100 + (texture - 100) * share).astype(dtype) for share in sharpness]


def image(pixels, number):
    return encode_image(Header.at(int((number + 1) * PERIOD), 'camera'), pixels)


def joint(stamp, z, names=('stage',)):
    return JointState(Header.at(int(stamp), ''), names, [z] * len(names)).encode()


def assembler(**settings):
    made = StackAssembler()
    made.configure(
        FocusSettings(), StackSettings(**({'pitch_x': 2e-6, 'pitch_y': 3e-6, 'z_step': STEP} | settings))
    )
    return made


def feed(made, pixels, start=0):
    return [event for number, frame in enumerate(pixels) for event in made.add_frame(image(frame, start + number))]


def reasons(events):
    return [event.reason for event in events if isinstance(event, Refusal)]


def clouds(events):
    return [event for event in events if isinstance(event, StackCloud)]


def test_a_stack_that_ended_early_is_a_cloud_with_a_warning():
    made = assembler(frames=9)
    feed(made, frames()[:5])
    (event,) = made.finish()
    assert 'A stack ended after 5 frames, where stack.frames says 9' in event.warning
    (whole,) = feed(made, frames(), 9)
    assert whole.warning == ''
    unknown = assembler()
    feed(unknown, frames()[:5])
    assert next(unknown.finish()).warning == ''


def test_a_stack_of_the_given_number_becomes_a_cloud_in_metres():
    made = assembler(frames=9, z_start=5e-3)
    (event,) = feed(made, frames())
    result = depth_from_focus(frames(), 5e-3 + STEP * np.arange(9))
    cloud = PointCloud.decode(event.points)
    xyz = cloud.xyz()
    np.testing.assert_array_equal(xyz[..., 2], result.depth.astype(np.float32))
    np.testing.assert_allclose(xyz[3, 4, :2], [4 * 2e-6, 3 * 3e-6])
    assert [field.name for field in cloud.fields] == ['x', 'y', 'z', 'intensity', 'quality']
    assert cloud.header == Header.at(9 * PERIOD, 'camera')
    np.testing.assert_array_equal(Image.decode(event.image).pixels(), result.image)
    assert event.depth_of_field == result.depth_of_field
    assert (event.frames, event.preview, made.running) == (9, False, False)


def test_z_comes_from_the_joint_states_interpolated_at_the_stamp():
    made = assembler(z_source='joint_states', frames=9)
    stamps = (np.arange(9) + 1) * PERIOD
    heights = 1e-3 + STEP * np.arange(9) + 2e-7 * np.sin(np.arange(9))
    events = []
    for stamp, frame, number in zip(stamps, frames(), range(9), strict=True):
        events += made.add_joint_state(joint(stamp - 5_000_000, heights[number] - 1e-8))
        events += made.add_frame(image(frame, number))
        events += made.add_joint_state(joint(stamp + 5_000_000, heights[number] + 1e-8))
    (event,) = events
    expected = depth_from_focus(frames(), heights)
    np.testing.assert_allclose(PointCloud.decode(event.points).xyz()[..., 2], expected.depth, rtol=1e-6)


def encoded(frame, encoding, number):
    """A serialized image of a gray part in white light, (H, W) uint8."""
    pixels = frame.astype('<u2') * 257 if encoding == 'mono16' else frame
    if encoding in ('rgb8', 'bgr8'):
        pixels = np.repeat(frame[..., np.newaxis], 3, axis=-1)
    writer = CdrWriter()
    Header.at((number + 1) * PERIOD, 'camera').write(writer)
    for size in frame.shape:
        writer.uint32(size)
    writer.string(encoding)
    writer.boolean(False)
    writer.uint32(pixels.strides[0])
    writer.octets(pixels.tobytes())
    return writer.finish()


@pytest.mark.parametrize('period', [2, 4, 8])
@pytest.mark.parametrize('encoding', ['mono8', 'mono16', 'rgb8', 'bgr8', 'bayer_rggb8'])
def test_contrast_of_a_ruling_is_no_flicker_in_any_encoding(encoding, period):
    """A mosaic, whose gray repeats its last row, shows one row more than whole periods."""
    images = [encoded(frame, encoding, number) for number, frame in enumerate(ruled(period, 0, axis=0)[0])]
    made = assembler(frames=len(images))
    (event,) = (event for each in images for event in made.add_frame(each))
    expected = depth_from_focus([Image.decode(each).gray() for each in images], STEP * np.arange(len(images)))
    heights = PointCloud.decode(event.points).xyz()[..., 2]
    np.testing.assert_array_equal(heights, expected.depth.astype(np.float32))
    assert event.flicker == expected.flicker
    assert event.flicker < (0.005 if encoding.startswith('bayer') else 0.001)


def test_frames_that_wait_behind_the_end_of_a_stack_belong_to_the_next():
    made = assembler(z_source='joint_states', frames=3)
    list(made.add_joint_state(joint(0, 0.0)))
    feed(made, frames(6))
    events = list(made.add_joint_state(joint(8 * PERIOD, 8e-6)))
    assert [event.frames for event in clouds(events)] == [3, 3]
    assert reasons(events) == []


def test_joint_states_say_nothing_where_z_is_counted():
    made = assembler(frames=9)
    assert list(made.add_joint_state(b'no message')) == []


def test_frames_wait_for_the_joint_state_behind_them():
    made = assembler(z_source='joint_states', frames=3)
    list(made.add_joint_state(joint(0, 0.0)))
    assert feed(made, frames(3)) == []
    events = list(made.add_joint_state(joint(4 * PERIOD, 4e-6)))
    assert len(clouds(events)) == 1


def test_a_frame_that_no_joint_state_covers_is_refused_and_the_others_go_on():
    made = assembler(z_source='joint_states')
    list(made.add_joint_state(joint(1.5 * PERIOD, 0.0)))
    events = feed(made, frames(4))
    events += made.add_joint_state(joint(10 * PERIOD, 1e-5))
    assert reasons(events) == ['A frame was refused: its stamp is before the first joint state.']
    assert clouds(made.finish())[0].frames == 3


def test_joint_states_too_far_apart_say_nothing_of_what_was_between():
    made = assembler(z_source='joint_states')
    list(made.add_joint_state(joint(0, 0.0)))
    feed(made, frames(1))
    assert 'are 2.0 s apart' in reasons(made.add_joint_state(joint(2e9, 1e-5)))[0]


def test_without_joint_states_frames_are_given_up_and_told_why():
    made = assembler(z_source='joint_states')
    events = feed(made, frames(MOST_WAITING + 2))
    assert len(events) == 2
    assert 'no joint state covers its stamp' in reasons(events)[0]
    assert reasons(made.finish()) == [f'{MOST_WAITING} frames were refused: no joint state covers their stamps.']
    feed(made, frames(1))
    assert reasons(made.finish()) == ['1 frame was refused: no joint state covers its stamp.']


@pytest.mark.parametrize(
    ('message', 'settings', 'sentence'),
    [
        (joint(1, 0.0), {'joint': 'z'}, "has no joint 'z'; it has: stage"),
        (joint(1, float('nan')), {}, 'has no finite position'),
        (joint(1, 0.0, ()), {}, 'has no finite position'),
        (b'\0\1\0\0', {}, 'ends early'),
    ],
)
def test_a_joint_state_that_says_nothing_is_refused(message, settings, sentence):
    made = assembler(z_source='joint_states', **settings)
    (reason,) = reasons(made.add_joint_state(message))
    assert sentence in reason


def test_the_named_joint_counts():
    made = assembler(z_source='joint_states', joint='stage', frames=9)
    for stamp in (0, 20 * PERIOD):
        state = JointState(Header.at(stamp, ''), ['turret', 'stage'], [9.0, stamp / PERIOD * STEP])
        list(made.add_joint_state(state.encode()))
    (event,) = feed(made, frames())
    assert np.nanmax(PointCloud.decode(event.points).xyz()[..., 2]) < 1e-5


@pytest.mark.parametrize(
    ('settings', 'sentence'),
    [({'pitch_x': 0.0}, 'stack.pitch_x is not set'), ({'z_step': 0.0}, 'stack.z_step is not set')],
)
def test_what_must_be_set_is_told_before_anything_wrong_is_published(settings, sentence):
    events = feed(assembler(**settings), frames(2))
    assert all(sentence in reason for reason in reasons(events))
    assert len(events) == 2


def test_a_pitch_along_y_that_is_not_given_is_the_one_along_x():
    (event,) = feed(assembler(pitch_y=0.0, frames=9), frames())
    assert PointCloud.decode(event.points).xyz()[1, 0, 1] == np.float32(2e-6)


def test_finishing_closes_what_runs_and_the_next_stack_works():
    made = assembler()
    feed(made, frames())
    (first,) = made.finish()
    assert first.frames == 9
    assert list(made.finish()) == []
    feed(made, frames(seed=1), start=20)
    (second,) = made.finish()
    assert second.frames == 9


def test_a_stack_with_too_few_frames_breaks_off_with_a_sentence():
    made = assembler()
    feed(made, frames(2))
    (reason,) = reasons(made.finish())
    assert 'A stack of 2 frames broke off' in reason
    assert not made.running


@pytest.mark.parametrize('other', [frames(1, (20, 30))[0], frames(1, dtype=np.uint16)[0]])
def test_a_frame_of_another_size_or_encoding_breaks_the_stack_off_and_begins_the_next(other):
    made = assembler(frames=3)
    feed(made, frames(2))
    events = list(made.add_frame(image(other, 5)))
    assert 'A stack of 2 frames broke off' in reasons(events)[0]
    assert made.running
    events = [event for number in (6, 7) for event in made.add_frame(image(other, number))]
    assert len(clouds(events)) == 1


FAULTS = {
    'lost': lambda scan, k: scan[:k] + scan[k + 1 :],
    'twice': lambda scan, k: scan[: k + 1] + scan[k:],
    'late': lambda scan, k: [*scan[:k], *reversed(scan[k : k + 2]), *scan[k + 2 :]],
    'two late': lambda scan, k: [*scan[:k], *scan[k + 2 : k + 3], *scan[k : k + 2], *scan[k + 3 :]],
    'other encoding': lambda scan, k: [*scan[:k], (scan[k][0].astype(np.uint16), scan[k][1]), *scan[k + 1 :]],
    'other size': lambda scan, k: [*scan[:k], (scan[k][0][:-1], scan[k][1]), *scan[k + 1 :]],
    'far ahead': lambda scan, k: [*scan[:k], (scan[k][0], scan[k][1] + 1000), *scan[k + 1 :]],
    'far behind': lambda scan, k: [*scan[:k], (scan[k][0], scan[k][1] - 1000), *scan[k + 1 :]],
    'far ahead from then on': lambda scan, k: [*scan[:k], *((pixels, at + 1000) for pixels, at in scan[k:])],
}


def scan_of(count, begin):
    """The frames of a scan and their numbers: a plane that is sharpest in the middle."""
    return [(pixels, begin + number) for number, pixels in enumerate(frames(count))]


def is_right(cloud, count):
    z = PointCloud.decode(cloud.points).xyz()[..., 2] / STEP
    return (np.abs(z - (count - 1) / 2) < 0.5)[np.isfinite(z)].all()


@pytest.mark.parametrize(
    ('fault', 'k'),
    [
        (fault, k)
        for fault in FAULTS
        for k in (0, 1, 2, 3, 7, 9, 10, 13, 14)
        if k or fault.startswith('far')  # nothing tells that the first frame is lost
    ],
)
@pytest.mark.parametrize(
    ('known', 'pause', 'finished'),
    [(True, 0, False), (True, 20, False), (True, 100, True), (False, 20, False), (False, 100, True)],
)
def test_a_fault_of_one_frame_gives_no_wrong_height_without_a_word_and_a_later_scan_is_right(
    fault, k, known, pause, finished
):
    """Where z is counted, by the stamps of a camera. `finished`: the pause is longer than the timeout."""
    count = 15
    made = assembler(frames=count if known else 0)
    begins = [2000 + number * (count + pause) for number in range(4)]
    if 'from then on' in fault:
        begins[1:] = [begin + 1000 for begin in begins[1:]]
    scans = [FAULTS[fault](scan_of(count, begins[0]), k), *(scan_of(count, begin) for begin in begins[1:])]
    told, found = [], []
    for number, scan in enumerate(scans):
        events = [event for pixels, at in scan for event in made.add_frame(image(pixels, at))]
        if finished or number == len(scans) - 1:
            events += made.finish()
        told += [cloud.warning for cloud in clouds(events) if cloud.warning] + reasons(events)
        for cloud in clouds(events):
            assert is_right(cloud, count) or told, number
        found.append(clouds(events))
    if not pause and fault.startswith('far'):
        assert told or (k == 0 and 'from then on' in fault)  # nothing tells any more where the next scan begins
        return
    # Without a number of frames and a timeout, the scan before ends with the first frame of this one.
    assert len(found[-1]) == (1 if known or finished else 2)
    assert is_right(found[-1][-1], count)
    assert found[-1][-1].warning == ''


def test_a_replay_in_a_loop_gives_a_cloud_in_each_pass_but_that_of_a_fault():
    for known in (True, False):
        made = assembler(frames=15 if known else 0)
        passes = [FAULTS['two late'](scan_of(15, 100), 7), *[scan_of(15, 100)] * 3]
        found = []
        for one in passes:
            events = [event for pixels, at in one for event in made.add_frame(image(pixels, at))]
            found.append(clouds(events + list(made.finish())))
        assert [len(each) for each in found[1:]] == [1, 1, 1]
        assert all(is_right(each[0], 15) for each in found[1:])


def test_time_that_goes_backwards_gives_the_stack_up_and_begins_the_next():
    made = assembler(frames=9)
    feed(made, frames(4), start=100)
    events = feed(made, frames())
    assert reasons(events) == ['Time went backwards by 2.060 s: the running stack was given up.']
    assert clouds(events)[0].frames == 9


def test_a_replay_that_begins_again_measures_the_same_again():
    made = assembler(z_source='joint_states', frames=9)

    def play():
        events = list(made.add_joint_state(joint(0, 0.0)))
        for number, frame in enumerate(frames()):
            events += made.add_frame(image(frame, number))
            events += made.add_joint_state(joint((number + 1.5) * PERIOD, (number + 1.5) * STEP))
        return events

    first, second = play(), play()
    assert [event.points for event in first] == [event.points for event in second]
    assert len(first) == 1


def test_a_stack_ends_where_z_turns_round_and_the_next_begins_there():
    made = assembler(z_source='joint_states', end_at_turn=True)
    up = STEP * np.arange(9)
    events = []
    list(made.add_joint_state(joint(0, 0.0)))
    for number, (frame, z) in enumerate(zip([*frames(), *frames(seed=1)], [*up, *up[::-1]], strict=True)):
        events += made.add_frame(image(frame, number))
        events += made.add_joint_state(joint((number + 1) * PERIOD, z))
    events += made.finish()
    first, second = clouds(events)
    assert first.frames + second.frames == 18
    assert abs(first.frames - second.frames) <= 2


def test_jitter_is_no_turn():
    made = assembler(z_source='joint_states', end_at_turn=True)
    jitter = 0.3 * STEP * np.random.default_rng(0).uniform(-1, 1, 40)
    list(made.add_joint_state(joint(0, 0.0)))
    events = []
    for number, frame in enumerate(frames(40)):
        events += made.add_frame(image(frame, number))
        events += made.add_joint_state(joint((number + 1) * PERIOD, STEP * number + jitter[number]))
    assert events == []
    assert clouds(made.finish())[0].frames == 40


def test_a_preview_comes_every_so_many_frames_and_ends_nothing():
    made = assembler(preview=3, frames=9)
    events = feed(made, frames())
    assert [(event.preview, event.frames) for event in events] == [(True, 3), (True, 6), (False, 9)]


def test_a_change_of_settings_waits_for_the_next_stack():
    made = assembler(frames=9)
    feed(made, frames(5))
    made.configure(FocusSettings(), StackSettings(pitch_x=1e-3, z_step=STEP, frames=3))
    (event,) = feed(made, frames()[5:], start=5)
    assert event.frames == 9
    (event,) = feed(made, frames(3), start=20)
    assert PointCloud.decode(event.points).xyz()[0, 1, 0] == np.float32(1e-3)


def test_bytes_that_are_no_image_are_refused():
    (reason,) = reasons(assembler().add_frame(b'\0\1\0\0'))
    assert reason.startswith('A frame was refused: ')


def test_a_frame_that_comes_twice_changes_nothing():
    made = assembler(z_source='joint_states')
    list(made.add_joint_state(joint(0, 0.0)))
    list(made.add_joint_state(joint(20 * PERIOD, 20 * STEP)))
    feed(made, frames())
    (once,) = made.finish()
    list(made.add_joint_state(joint(0, 0.0)))
    list(made.add_joint_state(joint(20 * PERIOD, 20 * STEP)))
    for number, frame in enumerate(frames()):
        for _ in range(2):
            list(made.add_frame(image(frame, number)))
    (twice,) = made.finish()
    assert once.points == twice.points


def test_the_size_of_the_cloud_is_known_while_the_stack_runs():
    made = assembler()
    assert made.cloud_size == 0
    feed(made, frames(3))
    assert made.cloud_size == 24 * 30 * 20
    (cloud,) = clouds(made.finish())
    assert PointCloud.decode(cloud.points).data_length == 24 * 30 * 20


# Frames that are lost on the way


def numbered(pixels, numbers):
    """Messages of the frames with these numbers."""
    return [image(pixels[number], number) for number in numbers]


def run(made, messages):
    return [event for message in messages for event in made.add_frame(message)]


@pytest.mark.parametrize('z_step', [STEP, -STEP])
@pytest.mark.parametrize('lost', [[3], [5, 6, 7], [2, 9], [1, 2, 3, 11]])
@pytest.mark.parametrize('count', [0, 15])
def test_z_is_counted_with_the_gaps_of_lost_frames(lost, z_step, count):
    pixels = frames(15)
    numbers = [number for number in range(15) if number not in lost]
    made = assembler(frames=count, z_step=z_step)
    events = [*run(made, numbered(pixels, numbers)), *made.finish()]
    (cloud,) = clouds(events)
    expected = depth_from_focus([pixels[number] for number in numbers], z_step * np.array(numbers))
    np.testing.assert_array_equal(PointCloud.decode(cloud.points).xyz()[..., 2], expected.depth.astype(np.float32))
    assert 'lost on the way, as the stamps show' in cloud.warning
    assert 'ended after' not in cloud.warning


def without(messages, lost):
    """Some of the messages, each with the number of those that are missing before it."""
    came = [number for number in range(len(messages)) if number not in lost]
    return [(messages[number], number - before - 1) for before, number in itertools.pairwise([-1, *came])]


def run_with_gaps(made, messages):
    return [event for message, missing in messages for event in made.add_frame(message, missing)]


@pytest.mark.parametrize('lost', [[3], [5, 6, 7], [2, 9], [1, 2, 3, 11]])
@pytest.mark.parametrize('count', [0, 15])
@pytest.mark.parametrize('stamps', ['not checked', 'alike'])
def test_where_the_stamps_tell_nothing_z_is_counted_with_the_gaps_that_the_publisher_tells(lost, count, stamps):
    pixels = frames(15)
    made = assembler(frames=count, check_stamps=stamps == 'alike')
    for number, frame in enumerate(pixels):
        frame[0, 0] = number  # frames of one stamp that are equal count as one that came twice
    messages = [image(frame, 0 if stamps == 'alike' else number) for number, frame in enumerate(pixels)]
    (cloud,) = clouds([*run_with_gaps(made, without(messages, lost)), *made.finish()])
    came = [number for number in range(15) if number not in lost]
    expected = depth_from_focus([pixels[number] for number in came], STEP * np.array(came))
    np.testing.assert_array_equal(PointCloud.decode(cloud.points).xyz()[..., 2], expected.depth.astype(np.float32))
    assert 'lost on the way, as the numbers of their publisher show; z is counted with the gaps.' in cloud.warning
    assert 'ended after' not in cloud.warning


def test_a_gap_that_missing_frames_fill_is_no_pause_between_two_stacks():
    messages = numbered(frames(25), range(25))
    (cloud,) = clouds([*run_with_gaps(made := assembler(), without(messages, range(4, 14))), *made.finish()])
    assert cloud.frames == 15
    assert (
        cloud.warning
        == '10 frames of a stack were lost on the way, as the stamps show; z is counted with the gaps.'
    )


def test_missing_frames_do_not_matter_where_joint_states_give_z():
    made, told = assembler(z_source='joint_states'), assembler(z_source='joint_states')
    for each in (made, told):
        list(each.add_joint_state(joint(0, 0.0)))
        list(each.add_joint_state(joint(10 * PERIOD, 10 * STEP)))
    messages = without(numbered(frames(), range(9)), [2, 3])
    run_with_gaps(told, messages)
    run(made, [message for message, _ in messages])
    (cloud,), (same,) = clouds(told.finish()), clouds(made.finish())
    assert (cloud.points, cloud.warning) == (same.points, '')


def test_scans_without_a_pause_stay_apart_though_frames_are_missing_where_they_meet():
    pixels = frames(15)
    messages = numbered(3 * pixels, range(15)) + numbered(3 * pixels, range(15, 45))
    made = assembler(frames=15, check_stamps=False)
    one, two, three = clouds(run_with_gaps(made, without(messages, range(12, 18))))
    assert 'A stack ended after 12 frames, where stack.frames says 15' in one.warning
    assert '6 frames were lost on the way just before a stack, of which z counts 3 as its own' in two.warning
    expected = depth_from_focus(pixels[3:], STEP * np.arange(3, 15))
    np.testing.assert_array_equal(PointCloud.decode(two.points).xyz()[..., 2], expected.depth.astype(np.float32))
    (alone,) = clouds(feed(assembler(frames=15, check_stamps=False), pixels))
    np.testing.assert_array_equal(PointCloud.decode(three.points).xyz(), PointCloud.decode(alone.points).xyz())
    assert three.warning == ''


@pytest.mark.parametrize('checked', [True, False])
def test_a_stack_tells_that_frames_before_its_first_one_are_missing(checked):
    made = assembler(check_stamps=checked)
    messages = numbered(frames(12), range(12))
    (cloud,) = clouds([*run_with_gaps(made, without(messages, [0, 1])), *made.finish()])
    assert '2 frames were lost on the way just before a stack, of which z counts none as its own' in cloud.warning


def test_what_is_missing_before_a_refused_frame_is_missing_before_the_next_one():
    made = assembler(check_stamps=False)
    messages = without(numbered(frames(), range(9)), [3])
    messages[3:3] = [(b'cut', 2)]
    (cloud,) = clouds([*run_with_gaps(made, messages), *made.finish()])
    assert '3 frames of a stack were lost on the way' in cloud.warning


def test_frames_of_the_next_scan_are_not_taken_for_lost_ones():
    made = assembler(frames=15)
    pixels = frames(15)
    first = [number for number in range(15) if number not in (6, 13, 14)]
    messages = numbered(pixels, first) + [image(frame, 40 + number) for number, frame in enumerate(pixels)]
    one, two = clouds(run(made, messages))
    assert (one.frames, two.frames) == (12, 15)
    assert 'A stack ended after 12 frames, where stack.frames says 15' in one.warning
    assert two.warning == ''
    alone = assembler(frames=15)
    np.testing.assert_array_equal(
        PointCloud.decode(two.points).xyz(), PointCloud.decode(clouds(feed(alone, pixels))[0].points).xyz()
    )


def test_a_long_pause_ends_a_stack_of_unknown_length():
    made = assembler()
    messages = numbered(frames(), range(9)) + [image(frame, 30 + number) for number, frame in enumerate(frames())]
    events = [*run(made, messages), *made.finish()]
    assert [cloud.frames for cloud in clouds(events)] == [9, 9]
    assert 'before a pause of 22 periods' in clouds(events)[0].warning


def test_stamps_that_fit_no_period_refuse_the_stack():
    made = assembler(frames=9)
    messages = [image(frame, number + (0.5 if number > 4 else 0)) for number, frame in enumerate(frames())]
    events = run(made, [message for number, message in enumerate(messages) if number != 4])
    events += made.finish()
    assert clouds(events) == []
    assert 'periods of 20 ms between its frames' in reasons(events)[0]
    unchecked = assembler(check_stamps=False)
    (cloud,) = clouds([*run(unchecked, messages), *unchecked.finish()])
    assert (cloud.frames, cloud.warning) == (9, '')


def test_a_jump_back_begins_the_next_stack():
    made = assembler(z_source='joint_states', frames=15)
    list(made.add_joint_state(joint(0, 0.0)))
    heights = STEP * np.r_[np.arange(12), np.arange(15)]
    events = []
    for number, (frame, z) in enumerate(zip([*frames(15)[:12], *frames(15)], heights, strict=True)):
        events += made.add_joint_state(joint((number + 1) * PERIOD, z))
        events += made.add_frame(image(frame, number))
    assert [cloud.frames for cloud in clouds(events)] == [12, 15]
    assert 'and the stage began again' in clouds(events)[0].warning


@pytest.mark.parametrize(('back', 'count'), [(5, 15), (6, 12)])
def test_a_jump_back_over_less_than_half_of_the_scan_ends_no_stack(back, count):
    made = assembler(z_source='joint_states', frames=15)
    list(made.add_joint_state(joint(0, 0.0)))
    heights = STEP * np.r_[np.arange(12), 11 - back + np.arange(3)]
    events = []
    for number, (frame, z) in enumerate(zip(frames(15), heights, strict=True)):
        events += made.add_joint_state(joint((number + 1) * PERIOD, z))
        events += made.add_frame(image(frame, number))
    assert clouds(events)[0].frames == count


def test_a_scan_from_the_other_end_after_a_pause_begins_the_next_stack():
    made = assembler(z_source='joint_states', frames=15)
    list(made.add_joint_state(joint(0, 0.0)))
    heights = STEP * np.r_[np.arange(12), np.arange(15)[::-1]]
    numbers = np.r_[np.arange(12), 20 + np.arange(15)]
    events = []
    for frame, z, number in zip([*frames(15)[:12], *frames(15)[::-1]], heights, numbers, strict=True):
        events += made.add_joint_state(joint((number + 1) * PERIOD, z))
        events += made.add_frame(image(frame, int(number)))
    assert [cloud.frames for cloud in clouds(events)] == [12, 15]


# What is refused leaves no trace


def cut_short(number):
    return image(np.zeros((24, 30), np.uint8), number)[:-7]


def unknown_encoding(number):
    return image(np.zeros((24, 30), np.uint8), number).replace(b'mono8', b'mono9')


def tiny_mosaic(number):
    frame = Image.decode(image(np.zeros((1, 30), np.uint8), number))
    return frame.message.replace(b'mono8\0', b'bayer\0')


def too_large(number):
    return image(np.zeros((40, 60), np.uint8), number)


REFUSED = (cut_short, unknown_encoding, tiny_mosaic, too_large)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 8), st.sampled_from(REFUSED), st.integers(-50, 10**9)), max_size=6),
    st.sampled_from(['step', 'joint_states']),
)
def test_refused_frames_change_nothing(refused, z_source):
    def run(extra):
        made = assembler(z_source=z_source, max_pixels=1000, frames=9)
        events = []
        for number, frame in enumerate(frames()):
            for at, make, stamp in extra:
                if at == number:
                    events += made.add_frame(make(stamp))
            events += made.add_frame(image(frame, number))
            events += made.add_joint_state(joint((number + 1) * PERIOD, number * STEP))
        return events

    events, expected = run(refused), run([])
    assert len(reasons(events)) == len(refused)
    assert [cloud.points for cloud in clouds(events)] == [cloud.points for cloud in clouds(expected)]
    assert len(clouds(events)) == 1


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 8), st.integers(PERIOD, 10**18)), max_size=6),
    st.integers(0, 3),
)
def test_frames_stamped_in_the_future_are_refused_and_cost_no_stack(wrong, states_ahead):
    """The stage is where it should be, so it is the stamp that is wrong, not the time."""

    def run(extra):
        made, events = assembler(z_source='joint_states', frames=9), []
        for number in range(states_ahead):
            events += made.add_joint_state(joint((number + 1) * PERIOD, number * STEP))
        for number, frame in enumerate(frames()):
            for at, ahead in extra:
                if at == number:
                    stamp = (number + states_ahead + 1) * PERIOD + ahead
                    events += made.add_frame(encode_image(Header.at(stamp, 'camera'), frame))
            at = number + states_ahead
            events += made.add_joint_state(joint((at + 1) * PERIOD, at * STEP))
            events += made.add_frame(image(frame, number))
        return events

    events, expected = run(wrong), run([])
    assert [cloud.points for cloud in clouds(events)] == [cloud.points for cloud in clouds(expected)]
    assert len(clouds(events)) == 1
    assert len(reasons(events)) == len(wrong)
    assert all('after that of the frame behind it' in reason for reason in reasons(events))


def test_time_that_went_back_with_the_stage_ends_the_stack_that_waits():
    made = assembler(z_source='joint_states', frames=9)
    list(made.add_joint_state(joint(1000 * PERIOD, 5.0)))
    list(made.add_frame(encode_image(Header.at(2000 * PERIOD, 'camera'), frames()[0])))
    (reason,) = reasons(made.add_frame(image(frames()[0], 0)))
    assert 'Time went backwards' in reason
    assert not made._track  # positions of another time say nothing of this frame


def test_a_frame_that_is_too_large_is_refused_with_the_memory_that_it_needs():
    (event,) = assembler(max_pixels=700).add_frame(image(frames()[0], 0))
    assert '720 pixels, more than stack.max_pixels (700)' in event.reason
    assert 'GB of memory' in event.reason


def test_joint_states_without_a_new_stamp_are_not_kept():
    made = assembler(z_source='joint_states')
    for z in range(20_000):
        assert not list(made.add_joint_state(joint(0, z * STEP)))
    assert len(made._track) == 1


def test_joint_states_without_frames_are_bounded():
    made = assembler(z_source='joint_states')
    for number in range(MOST_STATES + 500):
        list(made.add_joint_state(joint(1000 + number, 0.0)))
    assert len(made._track) <= MOST_STATES


def test_memory_can_be_released_between_stacks():
    made = assembler(frames=9)
    (first,) = feed(made, frames())
    made.release_memory()
    assert made._memory is None
    (second,) = feed(made, frames(), 9)
    assert PointCloud.decode(second.points).xyz().tobytes() == PointCloud.decode(first.points).xyz().tobytes()


def test_the_running_stack_keeps_its_memory():
    made = assembler(frames=9)
    feed(made, frames()[:4])
    made.release_memory()
    (cloud,) = feed(made, frames()[4:], 4)
    assert cloud.frames == 9


def test_a_stack_that_drifts_is_a_cloud_with_a_warning():
    steady, moved = (feed(assembler(frames=15), drifting_frames('flat', (0, x))[:15])[-1] for x in (1, 3))
    assert steady.warning == ''
    assert steady.drift == pytest.approx(1, abs=0.3)
    assert moved.drift == pytest.approx(3, abs=0.5)
    assert f'moved sideways by {moved.drift:.1f} pixels' in moved.warning
    assert 'clamp the part and the camera' in moved.warning


def test_a_registered_stack_has_no_warning_of_its_drift():
    frames = drifting_frames('flat', (0, 5))[:15]
    cloud = feed(assembler(frames=15, register=True), frames)[-1]
    assert cloud.registered.moved == pytest.approx(5, abs=0.6)
    assert cloud.registered.failed == 0
    assert cloud.warning == ''


def test_a_stack_whose_frames_cannot_be_registered_is_a_cloud_with_a_warning():
    frames = list(np.random.default_rng(0).integers(0, 255, (5, 60, 80), np.uint8))
    cloud = feed(assembler(frames=5, register=True), frames)[-1]
    assert cloud.registered.failed == 4
    assert '4 frames of a stack could not be registered' in cloud.warning


def test_a_stack_with_too_wide_steps_is_a_cloud_with_a_warning_that_names_a_step():
    fine = frames(33)
    assert feed(assembler(frames=33), fine)[-1].warning == ''
    (cloud,) = feed(assembler(frames=9, z_step=4 * STEP), fine[::4])
    assert 'Scan with steps of 1 µm, instead of 4 µm.' in cloud.warning
