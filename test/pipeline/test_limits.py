# SPDX-License-Identifier: Apache-2.0
"""Limits: which measurements pass."""

import numpy as np
import pytest
from examples import cloud, surface
from hypothesis import given
from hypothesis import strategies as st

from socialcircle_ros.metrics.areal import texture
from socialcircle_ros.pipeline.clouds import filter_cloud
from socialcircle_ros.pipeline.limits import TextureReason, verdict
from socialcircle_ros.settings import LimitSettings, PipelineSettings

HEIGHTS = surface()[..., 2]


def judge(heights=HEIGHTS, **limits):
    """The verdict on a cloud with these heights, of which all are kept."""
    xyz = np.dstack([*np.mgrid[: heights.shape[0], : heights.shape[1]][::-1], heights])
    kept = np.isfinite(heights)
    return verdict(LimitSettings(**limits), xyz, kept, int(kept.sum()))


def judge_shares(**limits):
    """The verdict on 200 points, of which 100 are measured and 90 kept; the cloud itself is not read."""
    return verdict(LimitSettings(**limits), None, np.arange(200).reshape(10, 20) < 90, 100)


def test_without_a_limit_there_is_no_verdict_and_no_cost():
    assert judge_shares() is None
    found = filter_cloud(cloud()).measurement
    assert found.values.verdict is None
    assert 'limits' not in found.times_ms
    assert not {'verdict', 'verdict_reason'} & found.status(timed=True).values.keys()


@pytest.mark.parametrize(
    ('limits', 'reasons'),
    [
        ({'outlier_share_max': 0.1}, []),
        ({'outlier_share_max': 0.05}, ['10 % of the measured points are outliers, more than 5 %.']),
        ({'measured_share_min': 0.5}, []),
        ({'measured_share_min': 0.51}, ['50 % of the points are measured, fewer than 51 %.']),
        (
            {'outlier_share_max': 0.01, 'measured_share_min': 1.0},
            ['10 % of the measured points are outliers, more than 1 %.', '50 % of the points are measured, fewer'],
        ),
    ],
)
def test_shares_are_held_to_their_limits(limits, reasons):
    found = judge_shares(**limits)
    assert found.passed == (not reasons)
    assert len(found.reasons()) == len(reasons)
    assert all(text.startswith(start) for text, start in zip(found.reasons(), reasons, strict=True))


@pytest.mark.parametrize(
    ('limits', 'counts', 'reason'),
    [
        ({'measured_share_min': 1.0}, (99_999, 99_999), '99.999 % of the points are measured, fewer than 100 %.'),
        (
            {'outlier_share_max': 1e-8}, (100_000, 99_999),
            '0.001 % of the measured points are outliers, more than 1 × 10⁻⁶ %.',
        ),
        (
            {'outlier_share_max': 0.123456}, (100_000, 87_654),
            '12.346 % of the measured points are outliers, more than 12.3456 %.',
        ),
    ],
)  # fmt: skip
def test_a_share_and_its_limit_are_never_written_alike(limits, counts, reason):
    measured, kept = counts
    found = verdict(LimitSettings(**limits), None, np.arange(100_000).reshape(100, 1000) < kept, measured)
    assert found.reasons() == (reason,)


def test_a_texture_and_its_limit_are_never_written_alike():
    value = texture(HEIGHTS).sq
    (reason,) = judge(sq_max=float(np.nextafter(value, 0))).reasons()
    shown, limit = reason.removeprefix('Sq is ').removesuffix(', in the unit of the cloud.').split(', above ')
    assert shown != limit
    assert float(shown) == pytest.approx(value)


@pytest.mark.parametrize(
    ('unit', 'sentence'),
    [
        ('m', 'Sq is 15.9187 µm, above 2 µm.'),
        ('um', 'Sq is 15.9187 pm, above 2 pm.'),
        (None, 'Sq is 1.59187 × 10⁻⁵, above 2 × 10⁻⁶, in the unit of the cloud.'),
        ('bolt', 'Sq is 1.59187 × 10⁻⁵, above 2 × 10⁻⁶, in the unit of the cloud.'),
    ],
)
def test_a_texture_and_its_limit_have_one_style_and_the_unit_where_it_is_known(unit, sentence):
    assert TextureReason('Sq', 1.59187e-5, 'above', 2e-6).sentence(unit) == sentence


@given(
    name=st.sampled_from(['sa', 'sq', 'sz']), factor=st.floats(0.1, 10), scale=st.sampled_from([1e-7, 1.0, 1e5])
)
def test_the_texture_of_the_kept_points_is_held_to_its_limits(name, factor, scale):
    heights = HEIGHTS * scale
    value = getattr(texture(heights), name)
    for end in ('min', 'max'):
        found = judge(heights, **{f'{name}_{end}': value * factor})
        assert found.passed == (factor <= 1 if end == 'min' else factor >= 1)


def test_a_tilt_over_an_uneven_x_fails_no_limit():
    y, x = np.mgrid[:70, :80].astype(float)
    x **= 1.5
    xyz = np.dstack([x, y, 0.2 * x + np.random.default_rng(0).normal(0, 0.01, x.shape)])
    kept = np.ones(x.shape, bool)
    assert verdict(LimitSettings(sq_max=0.011), xyz, kept, kept.size).passed


def test_a_cloud_without_a_texture_fails_limits_of_the_texture():
    assert judge(np.full((3, 4), np.nan), sa_max=1.0).reasons() == (
        'Sa is not known: fewer than three points are kept.',
    )


def test_a_measurement_says_whether_it_passed_and_why_not():
    failed = filter_cloud(cloud(), PipelineSettings(limits=LimitSettings(outlier_share_max=0.001))).measurement
    assert (failed.level, failed.values.verdict) == (2, 'failed')
    assert failed.values.verdict_reason == '0.46 % of the measured points are outliers, more than 0.1 %.'
    assert failed.message.startswith(f'Failed: {failed.values.verdict_reason} 26 of 5594')
    assert 'time_limits_ms' in failed.status(timed=True).values
    passed = filter_cloud(cloud(), PipelineSettings(limits=LimitSettings(sz_max=5.0, sz_min=1.0))).measurement
    assert (passed.level, passed.values.verdict, passed.values.verdict_reason) == (0, 'passed', None)
    assert passed.in_unit('m') is passed
    assert type(passed.values).from_text(passed.status(timed=False).values) == passed.values


def test_a_measurement_in_a_known_unit_says_it_wherever_it_says_why_it_failed():
    failed = filter_cloud(cloud(), PipelineSettings(limits=LimitSettings(sz_max=0.5))).measurement
    known = failed.in_unit('mm')
    assert failed.values.verdict_reason.endswith(', above 0.5, in the unit of the cloud.')
    assert known.values.verdict_reason.endswith(' mm, above 500 µm.')
    assert known.message == failed.message.replace(failed.values.verdict_reason, known.values.verdict_reason)
