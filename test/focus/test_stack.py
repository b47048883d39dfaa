import numpy as np
import pytest
from focus.stacks import make_stack
from naive import focus as naive

from socialcircle_ros.errors import StackError
from socialcircle_ros.focus import FocusStack, Reason, count_reasons, depth_from_focus, focus_measure
from socialcircle_ros.settings import FocusSettings
from socialcircle_ros.simulation import simulate

INNER = (slice(10, -10), slice(10, -10))  # where neither the blur's wrapping nor the border's windows matter


def same(one, other):
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name == 'depth')
        for name in ('depth', 'quality', 'image', 'reasons')
    )


def errors(result, truth):
    found = (result.depth - truth)[INNER]
    return found[np.isfinite(found)]


@pytest.fixture(scope='module')
def clean():
    return make_stack(dtype=np.uint16)


@pytest.fixture(scope='module')
def noisy():
    return make_stack(electrons=6000)


@pytest.fixture(scope='module')
def fine():
    """The step is a quarter of that of the others."""
    return make_stack(electrons=6000, width=5.2, margin=30.0)


@pytest.mark.parametrize(('name', 'most'), [('clean', 0.04), ('noisy', 0.08), ('fine', 0.10)])
def test_depth_is_right_within_a_small_part_of_the_step(name, most, request):
    stack = request.getfixturevalue(name)
    result = depth_from_focus(stack.frames, stack.z)
    wrong = errors(result, stack.truth)
    assert wrong.size == result.depth[INNER].size
    assert wrong.std() <= most
    assert abs(wrong.mean()) <= 0.01


@pytest.mark.parametrize('fit', ['gauss', 'gauss3'])
def test_fit_equals_the_reference(noisy, fit, monkeypatch):
    monkeypatch.setattr('socialcircle_ros.focus.stack.centred', lambda depth, *_: depth)
    settings = FocusSettings(fit=fit)
    result = depth_from_focus(noisy.frames, noisy.z, settings)
    curves = np.stack([focus_measure(frame, settings) for frame in noisy.frames])
    for row, column in np.random.default_rng(0).integers(10, 86, (60, 2)):
        curve = curves[:, row, column]
        best = int(np.argmax(curve))
        near = slice(best - 1, best + 2)
        expected = (
            naive.peak_of_three(noisy.z[near], curve[near])
            if fit == 'gauss3'
            else naive.peak_of_curve(noisy.z, curve, 7)
        )
        assert result.depth[row, column] == pytest.approx(expected, abs=2e-3)


def test_image_is_of_the_sharpest_frame(noisy):
    result = depth_from_focus(noisy.frames, noisy.z)
    curves = np.stack([focus_measure(frame) for frame in noisy.frames])
    best = curves.argmax(0)
    of_best = np.take_along_axis(noisy.frames, best[None], 0)[0]
    by_hair = np.sort(curves, 0)[-2] > 0.9996 * curves.max(0)  # codes do not tell these apart
    assert result.image.dtype == noisy.frames.dtype
    assert np.array_equal(result.image[~by_hair], of_best[~by_hair])


@pytest.mark.parametrize('name', ['clean', 'noisy'])
def test_order_does_not_matter(name, request):
    stack = request.getfixturevalue(name)
    upward = depth_from_focus(stack.frames, stack.z)
    count = len(stack.z)
    rng = np.random.default_rng(3)
    there_and_back = np.r_[0:count:2, count - 1 - count % 2 : 0 : -2]
    orders = [np.arange(count)[::-1], there_and_back, *(rng.permutation(count) for _ in range(3))]
    for order in orders:
        other = depth_from_focus(stack.frames[order], stack.z[order])
        assert np.array_equal(other.image, upward.image)
        assert np.array_equal(other.depth[INNER], upward.depth[INNER], equal_nan=True)
        assert np.array_equal(other.quality[INNER], upward.quality[INNER])
        assert np.array_equal(other.reasons[INNER], upward.reasons[INNER])


def test_order_matters_little_where_the_curves_are_wide_and_noisy(fine):
    upward = depth_from_focus(fine.frames, fine.z)
    order = np.random.default_rng(0).permutation(len(fine.z))
    shuffled = depth_from_focus(fine.frames[order], fine.z[order])
    assert np.mean(shuffled.reasons == upward.reasons) > 0.9
    assert np.nanquantile(np.abs(shuffled.depth - upward.depth), 0.9) < 0.01
    assert errors(shuffled, fine.truth).std() < 0.10


def test_frames_that_come_twice_change_nothing(noisy):
    twice = depth_from_focus(np.repeat(noisy.frames, 2, 0), np.repeat(noisy.z, 2))
    assert same(twice, depth_from_focus(noisy.frames, noisy.z))
    again = depth_from_focus([*noisy.frames, *noisy.frames[::-1]], [*noisy.z, *noisy.z[::-1]])
    assert same(again, depth_from_focus(noisy.frames, noisy.z))


def test_missing_frames_do_not_bias(clean):
    kept = np.delete(np.arange(len(clean.z)), [8, 12])
    wrong = errors(depth_from_focus(clean.frames[kept], clean.z[kept]), clean.truth)
    assert abs(wrong.mean()) < 0.03
    assert wrong.std() < 0.1


def test_one_frame_at_a_time_is_the_same_as_all_at_once(noisy):
    stack = FocusStack()
    for frame, z in zip(noisy.frames, noisy.z, strict=True):
        stack.add(frame, z)
    assert same(stack.finish(), depth_from_focus(noisy.frames, noisy.z))


def test_finishing_midway_shows_what_is_there_and_disturbs_nothing(noisy):
    stack = FocusStack()
    half = len(noisy.z) // 2
    for count, (frame, z) in enumerate(zip(noisy.frames, noisy.z, strict=True)):
        if count == half:
            midway = stack.finish()
            image = midway.image.copy()
        stack.add(frame, z)
    assert same(midway, depth_from_focus(noisy.frames[:half], noisy.z[:half]))
    assert np.array_equal(midway.image, image)
    assert same(stack.finish(), depth_from_focus(noisy.frames, noisy.z))


def test_a_stack_in_used_memory_is_as_a_new_one(clean, noisy, fine):
    stack = FocusStack()
    for measured in (clean, fine, noisy):  # other kinds of frames, then one that leaves its traces
        for frame, z in zip(measured.frames, measured.z, strict=True):
            stack.add(frame, z)
        last = stack.finish()
        stack.reset()
        assert stack.places == 0
    assert same(last, depth_from_focus(noisy.frames, noisy.z))


def test_depth_far_from_zero_in_small_steps_is_as_good(clean):
    """10 mm of offset, steps of 1 µm, in metres."""
    result = depth_from_focus(clean.frames, 0.01 + clean.z * 1e-6)
    wrong = (result.depth - 0.01)[INNER] * 1e6 - clean.truth[INNER]
    assert wrong.std() <= 0.04


@pytest.mark.parametrize('frames', [30, 60])
def test_memory_does_not_grow_with_the_number_of_frames(frames):
    stack = FocusStack()
    rng = np.random.default_rng(0)
    for place in range(frames):
        stack.add(rng.integers(0, 65535, (40, 50), np.uint16), place)
    held = sum(array.nbytes for array in vars(stack._curves).values())
    assert held == 48 * 40 * 50


def test_threshold_takes_noise_out_of_the_curve(noisy):
    result = depth_from_focus(noisy.frames, noisy.z, FocusSettings(threshold=12))
    assert errors(result, noisy.truth).std() < 0.08


class TestReasons:
    def test_a_peak_at_the_end_of_the_scan_has_no_depth(self, noisy):
        result = depth_from_focus(noisy.frames[: len(noisy.z) // 2], noisy.z[: len(noisy.z) // 2])
        end = noisy.z[len(noisy.z) // 2 - 1]
        beyond = ((noisy.truth > end + 0.5) & (noisy.truth < end + 2))[INNER]
        assert np.all(result.reasons[INNER][beyond] & Reason.SCAN_END)
        assert np.all(np.isnan(result.depth[INNER][beyond]))
        assert np.all(result.quality[INNER][beyond] == 0)

    def test_without_texture_there_is_no_depth(self):
        result = depth_from_focus(np.full((20, 40, 50), 90, np.uint8), np.arange(20))
        assert np.all(np.isnan(result.depth))
        assert np.all(result.quality == 0)
        assert np.all(result.reasons & Reason.LOW_CONTRAST)

    def test_of_pure_noise_little_is_taken_for_a_surface(self):
        noise = np.random.default_rng(0).normal(100, 3, (40, 96, 128))
        result = depth_from_focus(np.rint(noise).astype(np.uint8), np.arange(40))
        assert np.mean(np.isnan(result.depth[INNER])) > 0.75
        assert np.mean(result.quality[INNER] > 0.5) < 0.01
        assert np.mean(result.reasons[INNER] & Reason.LOW_CONTRAST > 0) > 0.9

    def test_saturated_texture_is_marked_there_alone(self, noisy):
        frames = noisy.frames.copy()
        frames[:, 30:60, 40:80] = np.minimum(frames[:, 30:60, 40:80].astype(int) * 4, 255)
        result = depth_from_focus(frames, noisy.z)
        saturated = (result.reasons & Reason.SATURATED) > 0
        assert saturated[36:54, 46:74].mean() > 0.9
        assert not saturated[:24].any()
        assert np.all(result.quality[saturated] == 0)

    def test_saturation_of_a_camera_of_12_bits_is_a_setting(self, noisy):
        frames = np.minimum(noisy.frames.astype(np.uint16) * 64, 4095)
        as_it_is = depth_from_focus(frames, noisy.z)
        told = depth_from_focus(frames, noisy.z, FocusSettings(saturation=4095))
        assert not np.any(as_it_is.reasons & Reason.SATURATED)
        assert np.mean(told.reasons & Reason.SATURATED > 0) > 0.5

    def test_a_second_peak_is_marked(self, noisy):
        """The whole stack once more above: every pixel is in focus twice."""
        frames = np.concatenate([noisy.frames, noisy.frames])
        step = float(np.median(np.diff(noisy.z)))
        z = np.concatenate([noisy.z, noisy.z - noisy.z[0] + noisy.z[-1] + step])
        result = depth_from_focus(frames, z)
        assert np.mean((result.reasons & Reason.TWO_PEAKS)[INNER] > 0) > 0.95
        assert not np.any(depth_from_focus(noisy.frames, noisy.z).reasons[INNER] & Reason.TWO_PEAKS)

    def test_a_good_pixel_has_none(self, noisy):
        result = depth_from_focus(noisy.frames, noisy.z)
        assert np.mean(result.reasons[INNER] == 0) > 0.99


@pytest.mark.parametrize('instrument', ['5x', '10x'])
def test_the_depth_of_field_is_read_from_the_curves(instrument):
    simulation = simulate('flat', 60, 80, seed=4, instrument=instrument)
    stack = FocusStack()
    for frame in simulation.frames():
        stack.add(frame.image, frame.z)
    assert stack.finish().depth_of_field == pytest.approx(simulation.optics.depth_of_field, rel=0.1)


def test_the_depth_of_field_goes_with_the_width_of_the_curves_and_with_the_unit_of_z():
    narrow = make_stack(electrons=6000, width=1.3, margin=16.0)
    wide = make_stack(electrons=6000, width=2.6, margin=16.0)
    of_narrow = depth_from_focus(narrow.frames, narrow.z).depth_of_field
    assert depth_from_focus(wide.frames, wide.z).depth_of_field == pytest.approx(2 * of_narrow, rel=0.1)
    assert depth_from_focus(narrow.frames, 1e-3 * narrow.z).depth_of_field == pytest.approx(1e-3 * of_narrow)


def test_no_curve_that_is_trusted_tells_no_depth_of_field():
    assert depth_from_focus(np.full((20, 40, 50), 90, np.uint8), np.arange(20)).depth_of_field is None


def test_saturated_curves_tell_no_depth_of_field(noisy):
    frames = np.minimum(noisy.frames.astype(int) * 4, 255).astype(np.uint8)
    result = depth_from_focus(frames, noisy.z)
    assert np.all(result.reasons & Reason.SATURATED)
    assert result.depth_of_field is None


def test_quality_is_the_share_of_good_pixels():
    """Good is within a quarter of the depth of field, which is about 1.1 times the half width here."""
    quality, good = [], []
    for seed, contrast in enumerate([0.02, 0.04, 0.06, 0.1, 0.3]):
        stack = make_stack(seed, electrons=6000, contrast=contrast, width=2.6, margin=16.0)
        result = depth_from_focus(stack.frames, stack.z)
        quality.append(result.quality[INNER].ravel())
        good.append(np.abs(result.depth - stack.truth)[INNER].ravel() < 2.6 * 1.1 / 4)
    quality, good = np.concatenate(quality), np.concatenate(good)
    for least in (0.5, 0.7, 0.9):
        above = quality >= least
        assert above.mean() > 0.1
        assert good[above].mean() >= least
    assert good[(quality > 0) & (quality < 0.5)].mean() < 0.7


class TestBadInput:
    @pytest.fixture
    def stack(self, noisy):
        stack = FocusStack()
        for frame, z in zip(noisy.frames[:8], noisy.z[:8], strict=True):
            stack.add(frame, z)
        return stack

    @pytest.mark.parametrize(
        ('frame', 'z', 'says'),
        [
            (np.zeros((5, 5), np.uint8), 1.0, r'\(5, 5\) uint8 cannot join a stack of \(96, 128\) uint8'),
            (np.zeros((96, 128), np.uint16), 1.0, 'uint16 cannot join'),
            (np.zeros((96, 128), np.float32), 1.0, 'must be uint8 or uint16'),
            (np.zeros((96, 128, 3), np.uint8), 1.0, 'must be a gray image'),
            (np.zeros((96, 128), np.uint8), float('nan'), 'finite z, not nan'),
            (np.zeros((96, 128), np.uint8), float('inf'), 'finite z, not inf'),
        ],
    )
    def test_is_refused_and_leaves_the_stack_unharmed(self, stack, frame, z, says):
        before = stack.finish()
        with pytest.raises(StackError, match=says):
            stack.add(frame, z)
        assert stack.places == 8
        assert same(stack.finish(), before)

    def test_too_few_frames(self, noisy):
        stack = FocusStack()
        with pytest.raises(StackError, match='three different z at least, not 0'):
            stack.finish()
        for z in (1.0, 2.0, 2.0):
            stack.add(noisy.frames[0], z)
        with pytest.raises(StackError, match='three different z at least, not 2'):
            stack.finish()

    def test_as_many_z_as_frames(self, noisy):
        with pytest.raises(StackError, match='3 frames and 2 z'):
            depth_from_focus(noisy.frames[:3], noisy.z[:2])


def test_the_result_does_not_depend_on_the_number_of_threads(monkeypatch):
    texture = np.random.default_rng(0).integers(0, 200, (41, 37)).astype(np.float32)
    stack = FocusStack()
    for place in range(15):
        stack.add((texture * np.exp(-(((place - 7) / 3) ** 2))).astype(np.uint8), float(place))
    one = stack.finish()
    monkeypatch.setattr('socialcircle_ros.kernels.bands._LEAST', 100)
    monkeypatch.setattr('socialcircle_ros.kernels.bands.limit', 3)
    three = stack.finish()
    for name in ('depth', 'quality', 'reasons', 'image'):
        np.testing.assert_array_equal(getattr(one, name), getattr(three, name))


def test_reasons_are_counted_each_by_itself():
    reasons = np.array([[0, Reason.NO_PEAK], [Reason.NO_PEAK | Reason.SATURATED, Reason.TWO_PEAKS]], np.uint8)
    counts = {'no_peak': 2, 'scan_end': 0, 'saturated': 1, 'two_peaks': 1, 'low_contrast': 0}
    assert count_reasons(reasons) == counts
