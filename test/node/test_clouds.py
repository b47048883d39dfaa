# SPDX-License-Identifier: Apache-2.0
"""Clouds through the live node."""

import numpy as np
import pytest
from examples import cloud, surface
from live import RELIABLE, RESULTS
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image, PointCloud2, PointField

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import DATATYPES, PointCloud, encode_point_cloud
from socialcircle_ros.node import cloud_filter

pytestmark = pytest.mark.live


def awkward(kind='<f4', *, rows=64, columns=70, seed=3):
    """A cloud message made by rclpy: fields out of order, gaps, padding behind rows, random bytes in them."""
    order = '>' if kind[0] == '>' else '<'
    size = np.dtype(kind).itemsize
    offsets = {'rgb': 1, 'z': 5, 'x': 5 + size, 'label': 5 + 2 * size, 'y': 7 + 2 * size}
    point_step = 9 + 3 * size
    row_step = point_step * columns + 13
    data = np.random.default_rng(seed).integers(0, 256, row_step * rows, np.uint8)
    codes = {code: number for number, code in DATATYPES.items()}
    kinds = {'rgb': 'u4', 'z': kind[1:], 'x': kind[1:], 'label': 'u2', 'y': kind[1:]}
    message = PointCloud2(height=rows, width=columns, point_step=point_step, row_step=row_step)
    message.header.frame_id = 'microscope'
    message.header.stamp.sec, message.header.stamp.nanosec = 17, 4
    message.is_bigendian = order == '>'
    message.is_dense = True
    message.fields = [
        PointField(name=name, offset=offset, datatype=codes[kinds[name]], count=1)
        for name, offset in offsets.items()
    ]
    xyz = surface(rows, columns, seed=seed)
    for axis, name in enumerate('xyz'):
        view(message, data, name)[...] = xyz[..., axis]
    message.data.frombytes(data.tobytes())
    return message


def view(message, data, name):
    field = next(field for field in message.fields if field.name == name)
    kind = ('>' if message.is_bigendian else '<') + DATATYPES[field.datatype]
    shape, strides = (message.height, message.width), (message.row_step, message.point_step)
    return np.ndarray(shape, kind, data, field.offset, strides)


def test_a_cloud_comes_back_with_nan_for_its_outliers_and_nothing_else_changed(cell):
    xyz = surface()
    filtered, mask, measurement = cell.clean(cloud())
    result = remove_outliers(xyz)
    expected = xyz.copy()
    expected[result.outliers] = np.nan
    np.testing.assert_array_equal(filtered.xyz(), expected)
    np.testing.assert_array_equal(mask == 255, result.outliers)
    np.testing.assert_array_equal(mask == 127, ~np.isfinite(xyz[..., 2]))
    assert measurement.values['outliers'] == '26'
    assert filtered.header == Header(1, 0, 'microscope')


@pytest.mark.parametrize('kind', ['<f4', '>f4', '<f8', '>f8'])
def test_every_field_padding_and_the_header_survive(cell, kind):
    message = awkward(kind)
    filtered, mask, _ = cell.clean(message)
    back = deserialize_message(bytes(filtered.message), PointCloud2)
    expected = np.frombuffer(bytes(message.data), np.uint8).copy()
    for name in 'xyz':
        view(message, expected, name)[mask == 255] = np.nan
    assert np.count_nonzero(mask == 255) == 26
    assert bytes(back.data) == expected.tobytes()
    assert back.is_dense is False
    for part in ('header', 'height', 'width', 'fields', 'is_bigendian', 'point_step', 'row_step'):
        assert getattr(back, part) == getattr(message, part)


def test_is_dense_is_computed_not_believed(cell):
    y, x = np.mgrid[:60, :64].astype(np.float32)
    flat = np.dstack([x, y, np.zeros_like(x)])
    message = bytearray(encode_point_cloud(Header(), flat))
    message[-1] = 0
    filtered, _, _ = cell.clean(bytes(message))
    assert filtered.is_dense


def broken(**changes):
    message = awkward()
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def without_z():
    return broken(fields=[field for field in awkward().fields if field.name != 'z'])


def with_whole_numbers():
    fields = awkward().fields
    for field in fields:
        if field.name in 'xyz':
            field.datatype = PointField.INT32
    return broken(fields=fields)


BAD = {
    'a name that is no text': (cloud().replace(b'x\0', b'\xff\0', 1), "no field 'x'; its fields are: \\udcff"),
    'not organized': (broken(height=1, width=64 * 70), 'not organized: height 1'),
    'no z': (without_z(), "no field 'z'"),
    'integers': (with_whole_numbers(), "field 'x' is 1 × INT32"),
    'cut short': (broken(data=awkward().data[:-1]), 'cut short'),
    'contradiction': (broken(row_step=10), 'contradicts itself'),
    'empty': (broken(height=0, width=0), 'The cloud is empty'),
    'nothing measured': (
        encode_point_cloud(Header(), np.full((9, 9, 3), np.nan, 'f4')),
        'No point of the cloud is measured',
    ),
}


@pytest.mark.parametrize('name', BAD)
def test_a_bad_cloud_is_counted_and_told_and_the_next_good_one_is_filtered(cell, name):
    message, sentence = BAD[name]
    cell.publish(message)
    found = cell.diagnosis(lambda found: found.values['clouds_refused'] == '1')
    assert sentence in found.status.message
    assert sentence in found.values['last_reason']
    assert found.status.level == b'\2'
    assert not any(cell.inbox[result] for result in RESULTS)
    _, _, measurement = cell.clean(cloud())
    assert measurement.values['outliers'] == '26'


def test_what_was_lost_stays_in_the_counts_after_the_next_good_cloud(cell):
    cell.publish(BAD['empty'][0])
    cell.diagnosis(lambda found: found.values['clouds_refused'] == '1')
    cell.clean(cloud())
    found = cell.diagnosis(lambda found: found.values['clouds_published'] == '1')
    assert found.values['clouds_refused'] == '1'
    assert found.values['clouds_received'] == '2'
    assert found.status.level == b'\1'


def test_clouds_that_come_faster_than_they_are_filtered_are_dropped_and_counted(cell):
    def burst():
        for stamp in range(1, 9):
            cell.publish(cloud(stamp=stamp))
        return any(int(found.values['clouds_dropped']) > 0 for found in cell.inbox['diagnostics'])

    cell.wait_for(burst)
    cell.forget()
    cell.publish(cloud(stamp=10**12))
    cell.wait_for(lambda: any(b'1000.0' in message for message in cell.inbox['social_circle/measurement']))
    counts = cell.diagnosis(
        lambda found: (
            int(found.values['clouds_received'])
            == int(found.values['clouds_published']) + int(found.values['clouds_dropped'])
        )
    )
    assert int(counts.values['clouds_dropped']) > 0


def test_clouds_that_the_middleware_replaces_are_counted_as_lost(cell):
    cell.clean(cloud())  # from here on the numbers of this publisher are known
    sent = 1

    def burst():
        nonlocal sent
        for stamp in range(1, 9):
            cell.publish(cloud(stamp=stamp))
        sent += 8
        return any(int(found.values['clouds_lost']) > 0 for found in cell.inbox['diagnostics'])

    def all_known(found):
        return int(found.values['clouds_received']) + int(found.values['clouds_lost']) == sent

    cell.wait_for(burst)
    cell.forget()
    cell.publish(cloud(stamp=10**12))
    sent += 1
    found = cell.diagnosis(all_known)
    assert int(found.values['clouds_lost']) > 0


def test_a_publisher_that_starts_again_is_heard_again(cell):
    cell.clean(cloud(seed=1))
    cell.peer.destroy_publisher(cell.clouds)
    cell.wait_for(lambda: cell.peer.count_publishers('points') == 0)
    cell.clouds = cell.peer.create_publisher(PointCloud2, 'points', 1)
    cell.wait_for(lambda: cell.clouds.get_subscription_count() == 1)
    _, _, measurement = cell.clean(cloud(seed=2))
    assert measurement.values['outliers'] == '26'


def test_a_mask_that_is_not_wanted_is_not_published(cell):
    cell.set(output__mask=False)
    cell.publish(cloud())
    cell.wait_for(lambda: cell.inbox['social_circle/measurement'])
    assert not cell.inbox['outlier_mask']


def test_holes_are_filled_when_repair_is_on(cell):
    received = []
    subscription = cell.peer.create_subscription(PointCloud2, 'points_repaired', received.append, 1, raw=True)
    cell.set(output__repaired=True)

    def repaired_cloud():
        answer = cell.clean(cloud())
        return received and (received[0], *answer)

    try:
        message, filtered, _, measurement = cell.wait_for(repaired_cloud)  # asked again until we are discovered
    finally:
        cell.set(output__repaired=False)
        cell.peer.destroy_subscription(subscription)
    repaired = PointCloud.decode(message).xyz()
    assert measurement.values['repaired'] == '26'
    kept = np.isfinite(filtered.xyz())
    np.testing.assert_array_equal(repaired[kept], filtered.xyz()[kept])
    assert np.count_nonzero(np.isnan(repaired[..., 2])) == 6


def test_the_adaptive_mode_tells_how_sure_it_is_of_each_point(cell):
    received = []
    subscription = cell.peer.create_subscription(Image, 'outlier_score', received.append, 1)
    cell.wait_for(lambda: cell.peer.count_publishers('outlier_score') == 1)
    cell.set(circle__mode='adaptive', output__score=True)
    try:
        _, mask, measurement = cell.clean(cloud())
        message = cell.wait_for(lambda: received)[0]
    finally:
        cell.peer.destroy_subscription(subscription)
    score = np.frombuffer(message.data, '<f4').reshape(message.height, message.width)
    expected = remove_outliers(surface(), CircleSettings(mode='adaptive'))
    assert (message.encoding, message.header.frame_id) == ('32FC1', 'microscope')
    np.testing.assert_array_equal(score, expected.score)
    np.testing.assert_array_equal(mask == 255, score > 0.5)
    assert measurement.values['circle.mode'] == 'adaptive'


def test_the_last_cloud_is_given_again_on_request_with_its_answer(cell):
    assert not cell.trigger('publish_last').success
    topic = 'social_circle/last_points'
    cell.inbox[topic] = []
    hearing = cell.peer.create_subscription(PointCloud2, topic, cell.keep(topic), RELIABLE, raw=True)
    cell.clean(cloud(stamp=3_000_000_000))

    def given():
        assert cell.trigger('publish_last').success
        return cell.inbox[topic]

    assert cell.wait_for(given)[0] == cloud(stamp=3_000_000_000)  # asked again until we are discovered
    _, mask, measurement = cell.answer()
    assert measurement.values['stamp'] == '3.000000000'
    assert (mask == 255).sum() == 26
    cell.peer.destroy_subscription(hearing)
    del cell.inbox[topic]


def test_a_cloud_that_fails_its_limits_is_told_in_the_measurement_and_in_diagnostics(cell):
    cell.set(limits__outlier_share_max=0.001)
    _, _, measurement = cell.clean(cloud())
    reason = '0.46 % of the measured points are outliers, more than 0.1 %.'
    assert (measurement.values['verdict'], measurement.values['verdict_reason']) == ('failed', reason)
    told = cell.diagnosis(lambda found: found.values['limits_failed'] == '1')
    assert told.status.message == f'The last measurement failed its limits: {reason}'
    cell.set(limits__outlier_share_max=0.01)
    assert cell.answer()[2].values['verdict'] == 'passed'
    passed = cell.diagnosis(lambda found: found.status.level == b'\0' and found.values['clouds_published'] == '1')
    assert passed.values['limits_failed'] == '1'


def test_what_is_reserved_for_large_clouds_is_given_back_after_a_far_smaller_one(monkeypatch):
    done = []
    monkeypatch.setattr(cloud_filter, 'give_back_freed_memory', lambda: done.append('all'))
    monkeypatch.setattr(cloud_filter, 'reserve_memory', lambda *sizes: done.append(sizes))
    cloud_filter._fit_memory(19_660_932)
    assert done == []
    cloud_filter._fit_memory(500_000)
    assert done == ['all', (2_500_000, 187_500)]
