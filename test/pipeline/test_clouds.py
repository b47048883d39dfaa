# SPDX-License-Identifier: Apache-2.0
"""One cloud through the whole pipeline."""

from dataclasses import replace

import numpy as np
import pytest
from examples import MARKS, NAN, marked

from socialcircle_ros import CircleSettings, SocialCircleError, remove_outliers
from socialcircle_ros.interface import FILTERED, MASK, MEASUREMENT, REPAIRED, SCORE, outputs_of
from socialcircle_ros.messages import diagnostics
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.image import NOT_MEASURED, Image, decode_mono8
from socialcircle_ros.messages.point_cloud import PointCloud, encode_point_cloud
from socialcircle_ros.pipeline import clouds
from socialcircle_ros.pipeline.clouds import filter_cloud, process_cloud
from socialcircle_ros.settings import OutputSettings, PipelineSettings

HEADER = Header(5, 6, 'microscope')


def surface(rows=70, columns=80, kind=np.float32):
    y, x = np.mgrid[:rows, :columns].astype(kind)
    z = np.sin(x / 9) + 0.1 * np.random.default_rng(1).random((rows, columns)).astype(kind)
    z[10, 12], z[40:44, 50:55] = 30, -25
    z[20:23, :9] = np.nan
    return np.dstack([x, y, z])


def settings(circle=None, output=None):
    return PipelineSettings(circle=circle or CircleSettings(), output=output or OutputSettings())


def outputs(xyz, circle=None, output=None):
    return filter_cloud(encode_point_cloud(HEADER, xyz), settings(circle, output))


def test_the_published_cloud_is_the_input_with_nan_for_its_outliers():
    xyz = surface()
    result = remove_outliers(xyz)
    expected = xyz.copy()
    expected[result.outliers] = np.nan
    published = PointCloud.decode(outputs(xyz).messages[FILTERED])
    np.testing.assert_array_equal(published.xyz(), expected)
    assert published.header == HEADER


@pytest.mark.parametrize('mark', MARKS.values(), ids=MARKS)
@pytest.mark.parametrize('method', ['spline', 'biharmonic'])
def test_a_mark_of_what_is_not_measured_is_no_surface_that_a_hole_is_filled_from(mark, method):
    wanted = PipelineSettings.from_ros({'output.repaired': True, 'repair.method': method, 'repair.largest': 200})
    results = [filter_cloud(encode_point_cloud(HEADER, marked(each)), wanted) for each in (mark, NAN)]
    of_mark, of_nan = (PointCloud.decode(each.messages[REPAIRED]).xyz() for each in results)
    assert results[0].messages[MASK] == results[1].messages[MASK]
    assert results[0].measurement.values.repaired == results[1].measurement.values.repaired
    unmeasured = decode_mono8(results[0].messages[MASK]) == NOT_MEASURED
    np.testing.assert_array_equal(of_mark[~unmeasured], of_nan[~unmeasured])
    np.testing.assert_array_equal(of_mark[unmeasured], marked(mark)[unmeasured])  # as they came


@pytest.mark.parametrize('mode', ['paper', 'adaptive'])
def test_outputs_are_emitted_in_their_order_and_the_same_as_those_that_are_kept(mode):
    wanted = settings(CircleSettings(mode=mode), OutputSettings(score=True, repaired=True))
    emitted = {}
    for xyz in (surface(90, 95), surface()):  # the second one may lie in the memory of the first
        message = encode_point_cloud(HEADER, xyz)
        emitted.clear()
        measurement = process_cloud(
            message, lambda topic, output: emitted.update({topic: bytes(output)}), wanted, lend=True
        )

    kept = filter_cloud(message, wanted)
    assert list(kept.messages) == [*emitted, MEASUREMENT] == list(outputs_of(mode, wanted.output))
    assert {**emitted, MEASUREMENT: kept.messages[MEASUREMENT]} == kept.messages
    assert measurement.values == kept.measurement.values
    assert measurement.times_ms.keys() == kept.measurement.times_ms.keys()


@pytest.mark.parametrize('failing', [FILTERED, MASK, SCORE, REPAIRED])
def test_an_output_that_fails_takes_no_other_with_it(failing):
    wanted = settings(CircleSettings(mode='adaptive'), OutputSettings(score=True, repaired=True))
    message = encode_point_cloud(HEADER, surface())
    emitted = {}

    def emit(topic, output):
        if topic is failing:
            raise ZeroDivisionError('a fault')
        emitted[topic] = bytes(output)

    measurement = process_cloud(message, emit, wanted)

    kept = filter_cloud(message, wanted)
    others = (topic for topic in kept.messages if topic not in (failing, MEASUREMENT))
    assert emitted == {topic: kept.messages[topic] for topic in others}
    assert list(measurement.failures) == [failing]
    assert measurement.values == kept.measurement.values
    assert measurement.level == diagnostics.ERROR
    assert f'{failing.name} of a cloud is missing: ZeroDivisionError: a fault' in measurement.message


def test_a_repair_that_fails_leaves_the_cloud_and_the_mask(monkeypatch):
    wanted = settings(output=OutputSettings(repaired=True))
    message = encode_point_cloud(HEADER, surface())
    monkeypatch.setattr(clouds, 'repair_holes', None)
    emitted = []
    measurement = process_cloud(message, lambda topic, _: emitted.append(topic), wanted)
    assert emitted == [FILTERED, MASK]
    assert measurement.values.repaired == 0
    assert 'points_repaired of a cloud is missing' in measurement.message
    with pytest.raises(TypeError):  # offline, a recording is whole or is not made
        filter_cloud(message, wanted)


def test_the_message_is_never_altered():
    memory = bytearray(encode_point_cloud(HEADER, surface()))
    before = bytes(memory)
    process_cloud(memoryview(memory), lambda topic, output: None, settings(output=OutputSettings(repaired=True)))
    assert memory == before


def test_the_mask_says_kept_outlier_and_not_measured():
    xyz = surface()
    mask = decode_mono8(outputs(xyz).messages[MASK])
    assert mask[10, 12] == 255
    assert mask[20, 0] == 127
    assert mask[0, 0] == 0


@pytest.mark.parametrize(
    ('height', 'filtered', 'repaired'), [(0, True, True), (50, False, True), (np.nan, False, False)]
)
def test_is_dense_is_computed_not_believed(height, filtered, repaired):
    flat = np.dstack([*np.mgrid[:70, :80].astype(np.float32)[::-1], np.zeros((70, 80), np.float32)])
    flat[30, 30, 2] = height
    found = outputs(flat, output=OutputSettings(repaired=True)).messages
    assert PointCloud.decode(found[FILTERED]).is_dense == filtered
    assert PointCloud.decode(found[REPAIRED]).is_dense == repaired


def test_counts_add_up():
    result = outputs(surface())
    values = result.measurement.status(timed=True).values
    assert int(values['points']) == 70 * 80
    assert int(values['measured']) == 70 * 80 - 27
    assert int(values['kept']) + int(values['outliers']) == int(values['measured'])
    assert int(values['outliers']) == 21 == result.measurement.values.outliers


def test_the_measurement_tells_seed_radius_times_and_settings():
    xyz = surface()
    circle = CircleSettings(mode='paper', radius=3, radius_scale=0.5, vote_region=(0, 0, 70, 70))
    found = remove_outliers(xyz, circle)
    values = outputs(xyz, circle).measurement.status(timed=True).values
    assert (int(values['seed_row']), int(values['seed_column'])) == found.seed
    assert float(values['radius']) == found.radius == 1.5
    assert values['circle.vote_region'] == '[0, 0, 70, 70]'
    assert values['stamp'] == '5.000000006'
    stages = ('decode', 'vote', 'radius', 'expansion', 'cloud', 'mask')
    times = {stage: float(values[f'time_{stage}_ms']) for stage in (*stages, 'total')}
    assert times['total'] == pytest.approx(sum(times[stage] for stage in stages), abs=0.01)


def test_the_same_cloud_gives_the_same_bytes():
    first, second = outputs(surface()), outputs(surface())
    assert first.messages == second.messages


def test_a_mask_that_is_not_wanted_is_not_made():
    assert outputs(surface(), output=OutputSettings(mask=False)).messages.keys() == {FILTERED, MEASUREMENT}


def test_a_circle_that_stayed_on_a_minority_warns():
    xyz = surface()
    xyz[:, 30:, 2] += 500
    result = outputs(xyz, CircleSettings(mode='paper', vote_region=(0, 0, 70, 30)))
    assert result.measurement.level == diagnostics.WARN
    assert 'more than half' in result.measurement.message


def test_a_cloud_without_any_measured_point_is_refused():
    with pytest.raises(
        SocialCircleError, match='No point of the cloud is measured: each has a NaN or Inf coordinate'
    ):
        outputs(np.full((70, 80, 3), np.nan, np.float32), CircleSettings(mode='paper'))


def test_a_repaired_cloud_differs_from_the_input_only_where_outliers_were():
    xyz = surface()
    result = outputs(xyz, output=OutputSettings(repaired=True))
    outliers = remove_outliers(xyz).outliers
    repaired = PointCloud.decode(result.messages[REPAIRED]).xyz()
    np.testing.assert_array_equal(repaired[~outliers], xyz[~outliers])
    filled = outliers & np.isfinite(repaired).all(axis=2)
    assert np.count_nonzero(filled) == result.measurement.values.repaired == 21
    np.testing.assert_allclose(repaired[filled][:, 2], np.sin(xyz[filled][:, 0] / 9), atol=0.4)
    assert 'repair' in result.measurement.times_ms


def test_a_measurement_warns_of_heights_that_the_repair_invents():
    y, x = np.mgrid[:60, :80].astype(np.float32)
    z = np.where(x < 30, 0, 10).astype(np.float32)
    z[2:58, 31:47] = 1000
    wanted = {'output.repaired': True, 'circle.mode': 'paper', 'circle.radius': 20.0}
    message = encode_point_cloud(HEADER, np.dstack([x, y, z]))
    bounded, invented = (
        filter_cloud(message, PipelineSettings.from_ros({**wanted, 'repair.method': method})).measurement
        for method in ('biharmonic', 'spline')
    )
    assert bounded.values.repaired == invented.values.repaired == 896
    assert (bounded.level, bounded.warnings) == (diagnostics.OK, ())
    (warning,) = invented.warnings
    assert 'of 896 filled points are far above or below all heights round their hole' in warning
    assert invented.level == diagnostics.WARN
    assert warning in invented.message


def test_nothing_is_repaired_unless_it_is_wanted():
    result = outputs(surface())
    assert REPAIRED not in result.messages
    assert result.measurement.values.repaired == 0


# The adaptive mode

ADAPTIVE = CircleSettings(mode='adaptive')


def rough(rows=160, columns=200):
    xyz = surface(rows, columns)
    xyz[..., 2] = np.random.default_rng(1).normal(0, 1, (rows, columns))
    xyz[20:23, :9, 2] = np.nan
    xyz[30, 40, 2] = 30
    return xyz


def test_points_kept_by_the_adaptive_mode_are_byte_for_byte_the_input():
    xyz = rough()
    outliers = remove_outliers(xyz, ADAPTIVE).outliers
    published = PointCloud.decode(outputs(xyz, ADAPTIVE).messages[FILTERED]).xyz()
    assert published[~outliers].tobytes() == xyz[~outliers].tobytes()
    assert np.isnan(published[outliers]).all()
    assert outliers[30, 40]


def test_a_stack_s_depth_of_field_decides_unless_the_settings_give_one():
    xyz = rough()
    xyz[60:68, 90:98, 2] += 20
    message = encode_point_cloud(HEADER, xyz)
    alone, known = filter_cloud(message, settings(ADAPTIVE)), filter_cloud(message, settings(ADAPTIVE), 100.0)
    given = filter_cloud(message, settings(replace(ADAPTIVE, depth_of_field=1.0)), 100.0)
    assert known.measurement.values.outliers == 0 < alone.measurement.values.outliers
    assert given.measurement.values.outliers > 0
    assert known.measurement.settings['circle.depth_of_field'] == '100.0'
    assert given.measurement.settings['circle.depth_of_field'] == '1.0'
    assert given.measurement.values.stack_depth_of_field == known.measurement.values.stack_depth_of_field == 100.0
    assert 'stack_depth_of_field' not in alone.measurement.status(timed=False).values


def test_the_score_is_the_adaptive_mode_s_as_an_image_with_the_cloud_s_header():
    xyz = rough()
    image = Image.decode(outputs(xyz, ADAPTIVE, OutputSettings(score=True)).messages[SCORE])
    score = np.frombuffer(image.message, '<f4', image.height * image.width, image.data_start)
    np.testing.assert_array_equal(score.reshape(160, 200), remove_outliers(xyz, ADAPTIVE).score)
    assert (image.encoding, image.header) == ('32FC1', HEADER)


def test_a_score_that_is_not_wanted_is_not_made_nor_one_in_the_paper_s_mode():
    assert SCORE not in outputs(rough(), ADAPTIVE).messages
    assert SCORE not in outputs(surface(), CircleSettings(mode='paper'), OutputSettings(score=True)).messages


def test_what_the_method_could_not_decide_is_a_warning_of_the_measurement():
    xyz, rules = rough(), CircleSettings(judge='rules')
    assert outputs(xyz, rules).measurement.level == diagnostics.OK
    for top in range(10, 150, 20):
        for left in range(10, 190, 20):
            xyz[top : top + 6, left : left + 6, 2] += 20
    measurement = outputs(xyz, rules).measurement
    assert measurement.level == diagnostics.WARN
    assert 'islands of one height were kept as the texture of the surface' in measurement.message


def test_a_warning_that_begins_with_a_parameter_keeps_its_spelling():
    found = outputs(surface(), CircleSettings(radius_scale=2.0)).measurement.message
    assert '. circle.radius_scale has no effect in the adaptive mode' in found


def test_a_cloud_without_any_measured_point_is_refused_by_the_adaptive_mode():
    with pytest.raises(SocialCircleError, match='No point of the cloud is measured'):
        outputs(np.full((70, 80, 3), np.nan, np.float32), ADAPTIVE)
