# SPDX-License-Identifier: Apache-2.0
"""Clouds looked at in place, and written with their outliers taken out."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from socialcircle_ros.errors import MessageError
from socialcircle_ros.kernels import bands
from socialcircle_ros.messages.cdr import CdrWriter
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import (
    DATATYPES,
    PointCloud,
    encode_layout,
    encode_point_cloud,
    write_float_cloud,
)
from socialcircle_ros.recording import schema_text

generate_dynamic = pytest.importorskip('mcap_ros2._dynamic', reason='needs mcap-ros2-support').generate_dynamic

DECODE = generate_dynamic('sensor_msgs/PointCloud2', schema_text('sensor_msgs/msg/PointCloud2'))[
    'sensor_msgs/PointCloud2'
]
"""A decoder of another project."""


@dataclass
class Parts:
    """A PointCloud2 part by part, so that each can be wrong."""

    height: int
    width: int
    fields: list
    point_step: int
    row_step: int
    data: bytes
    bigendian: bool = False
    dense: bool = True

    def message(self):
        writer = CdrWriter()
        Header(12, 34, 'microscope').write(writer)
        writer.uint32(self.height)
        writer.uint32(self.width)
        writer.uint32(len(self.fields))
        for name, offset, datatype, count in self.fields:
            writer.string(name)
            writer.uint32(offset)
            writer.uint8(datatype)
            writer.uint32(count)
        writer.boolean(self.bigendian)
        writer.uint32(self.point_step)
        writer.uint32(self.row_step)
        writer.octets(self.data)
        writer.boolean(self.dense)
        return writer.finish()


def plain(**changes):
    height, width = 3, 4
    fields = [('x', 0, 7, 1), ('y', 4, 7, 1), ('z', 8, 7, 1)]
    parts = Parts(height, width, fields, 12, 12 * width, np.arange(3 * height * width, dtype='<f4').tobytes())
    for name, value in changes.items():
        setattr(parts, name, value)
    return parts


@st.composite
def layouts(draw):
    """Clouds as drivers make them: any order and gaps, padding behind rows, both byte orders, other fields."""
    height, width = draw(st.integers(2, 5)), draw(st.integers(1, 6))
    names = draw(st.permutations(['x', 'y', 'z', *draw(st.sampled_from([[], ['intensity'], ['rgb', 'ring']]))]))
    same = draw(st.sampled_from([7, 8, None]))
    fields, offset = [], 0
    for name in names:
        offset += draw(st.integers(0, 5))
        coordinate = name in 'xyz'
        datatype = (same or draw(st.sampled_from([7, 8]))) if coordinate else draw(st.integers(1, 8))
        fields.append((name, offset, datatype, 1))
        offset += np.dtype(DATATYPES[datatype]).itemsize
    point_step = offset + draw(st.integers(0, 5))
    row_step = point_step * width + draw(st.integers(0, 9))
    trailing = draw(st.integers(0, 3))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    data = bytearray(rng.integers(0, 256, row_step * height + trailing, np.uint8).tobytes())
    bigendian = draw(st.booleans())
    xyz = rng.normal(0, 10, (height, width, 3))
    xyz[rng.random(xyz.shape) < 0.1] = draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    parts = Parts(height, width, fields, point_step, row_step, b'', bigendian, draw(st.booleans()))
    for axis, name in enumerate('xyz'):
        view(parts, data, name)[...] = xyz[..., axis]
    parts.data = bytes(data)
    return parts, rng.random((height, width)) < 0.4


def view(parts, data, name):
    _, offset, datatype, _ = next(field for field in parts.fields if field[0] == name)
    kind = ('>' if parts.bigendian else '<') + DATATYPES[datatype]
    return np.ndarray((parts.height, parts.width), kind, data, offset, (parts.row_step, parts.point_step))


@given(layouts())
def test_coordinates_are_read_whatever_the_layout(case):
    parts, _ = case
    xyz = PointCloud.decode(parts.message()).xyz()
    assert xyz.shape == (parts.height, parts.width, 3)
    assert xyz.dtype.isnative
    for axis, name in enumerate('xyz'):
        np.testing.assert_array_equal(xyz[..., axis], view(parts, parts.data, name))


@settings(max_examples=300)
@given(layouts(), st.integers(1, 4))
def test_only_coordinates_of_outliers_and_is_dense_change_on_any_number_of_threads(case, threads):
    parts, outliers = case
    message = parts.message()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('socialcircle_ros.kernels.bands._LEAST', 1)
        patch.setattr('socialcircle_ros.kernels.bands.limit', threads)
        changed = PointCloud.decode(message).without(outliers, dense=False)
    expected = bytearray(parts.data)
    for name in 'xyz':
        view(parts, expected, name)[outliers] = np.nan
    parts.data, parts.dense = bytes(expected), False
    assert changed == parts.message()


@given(layouts())
def test_the_input_is_never_altered(case):
    parts, outliers = case
    message = parts.message()
    copy = bytes(bytearray(message))
    PointCloud.decode(message).without(outliers, dense=True)
    assert message == copy


@settings(max_examples=300)
@given(layouts(), st.booleans())
def test_writing_into_a_reused_buffer_gives_the_same_message(case, dense):
    parts, outliers = case
    message = parts.message()
    used = bytearray(b'\xa5' * len(message))

    PointCloud.decode(message).write_without(outliers, memoryview(used), dense=dense)

    assert used == PointCloud.decode(message).without(outliers, dense=dense)


def test_the_message_is_the_same_for_any_number_of_threads(monkeypatch):
    height, width = 90, 70
    message = plain(
        height=height, width=width, row_step=12 * width + 5, data=bytes(height * (12 * width + 5))
    ).message()
    outliers = np.random.default_rng(0).random((height, width)) < 0.3
    monkeypatch.setattr(bands, '_LEAST', 100)
    found = set()
    for threads in (1, 2, 5):
        monkeypatch.setattr(bands, 'limit', threads)
        found.add(PointCloud.decode(message).without(outliers, dense=False))
    assert len(found) == 1


def test_coordinates_in_memory_that_may_be_written_to_are_read_only_all_the_same():
    memory = memoryview(bytearray(plain().message()))
    assert not PointCloud.decode(memory).xyz().flags.writeable


def test_a_row_step_of_the_whole_cloud_is_read_as_rows_without_padding_and_kept_as_it_came():
    """PointCloud2Modifier::resize(width, height) of Jazzy's sensor_msgs leaves width * height * point_step."""
    packed, whole = plain().message(), plain(row_step=12 * 4 * 3).message()
    cloud = PointCloud.decode(whole)
    np.testing.assert_array_equal(cloud.xyz(), PointCloud.decode(packed).xyz())
    outliers = np.zeros((3, 4), bool)
    outliers[1, 2] = True
    filtered = cloud.without(outliers, dense=False)
    assert DECODE(filtered).row_step == 12 * 4 * 3
    np.testing.assert_array_equal(
        PointCloud.decode(filtered).xyz(),
        PointCloud.decode(PointCloud.decode(packed).without(outliers, dense=False)).xyz(),
    )


def test_a_row_step_of_the_whole_cloud_is_refused_where_the_data_does_not_fit_it():
    with pytest.raises(MessageError, match='cut short'):
        PointCloud.decode(plain(row_step=12 * 4 * 3, data=bytes(12 * 4 * 3 + 1)).message()).xyz()


def test_a_count_of_0_that_a_driver_left_is_one_value():
    without = plain(fields=[('x', 0, 7, 0), ('y', 4, 7, 0), ('z', 8, 7, 0)])
    found, expected = (PointCloud.decode(each.message()).xyz() for each in (without, plain()))
    np.testing.assert_array_equal(found, expected)


def test_coordinates_of_unlike_types_at_even_distances_are_read():
    layout = np.dtype({'names': list('xyz'), 'formats': ['f8', 'f4', 'f4'], 'offsets': [0, 8, 16], 'itemsize': 24})
    points = np.zeros((2, 3), layout)
    xyz = np.arange(18.0).reshape(2, 3, 3)
    for axis, name in enumerate('xyz'):
        points[name] = xyz[..., axis]
    message = encode_layout(Header(), points, points.view(np.uint8))
    np.testing.assert_array_equal(PointCloud.decode(message).xyz(), xyz)


def test_evenly_spaced_coordinates_are_not_copied():
    message = plain().message()
    xyz = PointCloud.decode(message).xyz()
    assert np.shares_memory(xyz, np.frombuffer(message, np.uint8))
    assert not xyz.flags.writeable


def test_rows_are_y_and_columns_are_x():
    xyz = PointCloud.decode(plain(height=2, width=5, row_step=60).message()).xyz()
    assert xyz.shape == (2, 5, 3)
    assert xyz[1, 0].tolist() == [15, 16, 17]


@pytest.mark.parametrize(
    ('changes', 'sentence'),
    [
        ({'height': 0, 'data': b''}, 'The cloud is empty: height 0, width 4'),
        ({'width': 0, 'data': b''}, 'The cloud is empty: height 3, width 0'),
        ({'height': 1, 'width': 12}, 'The cloud is not organized: height 1, width 12'),
        ({'fields': []}, "has no field 'x'; its fields are: none"),
        ({'fields': [('x', 0, 7, 1), ('y', 4, 7, 1)]}, "has no field 'z'; its fields are: x, y"),
        ({'fields': [('x', 0, 5, 1), ('y', 4, 7, 1), ('z', 8, 7, 1)]}, "field 'x' is 1 × INT32"),
        ({'fields': [('x', 0, 9, 1), ('y', 4, 7, 1), ('z', 8, 7, 1)]}, "field 'x' is 1 × unknown datatype 9"),
        ({'fields': [('x', 0, 7, 3), ('y', 4, 7, 1), ('z', 8, 7, 1)]}, "field 'x' is 3 × FLOAT32"),
        (
            {'fields': [('x', 0, 7, 1), ('y', 4, 7, 1), ('z', 9, 7, 1)]},
            "'z' at offset 9 does not fit into a point",
        ),
        (
            {'fields': [('x', 0, 7, 1), ('y', 2, 7, 1), ('z', 8, 7, 1)]},
            "the fields 'x' and 'y' overlap, at offsets 0 and 2",
        ),
        (
            {'fields': [('x', 4, 7, 1), ('y', 0, 8, 1), ('z', 8, 7, 1)]},
            "the fields 'y' and 'x' overlap, at offsets 0 and 4",
        ),
        ({'data': bytes(143)}, 'The cloud is cut short: data has 143 bytes'),
        ({'row_step': 47}, 'contradicts itself: row_step is 47, but 4 points of 12 bytes take 48'),
        ({'row_step': 0}, 'contradicts itself: row_step is 0'),
        ({'point_step': 0, 'row_step': 0}, 'contradicts itself'),
        ({'height': 2**32 - 1, 'width': 2**31, 'row_step': 2**32 - 1}, 'contradicts itself'),
    ],
)
def test_a_cloud_that_cannot_be_used_is_refused_with_the_reason(changes, sentence):
    with pytest.raises(MessageError, match=sentence):
        PointCloud.decode(plain(**changes).message()).xyz()


@given(st.integers(0, 200))
def test_a_message_that_is_cut_short_is_refused(length):
    message = plain().message()
    with pytest.raises(MessageError):
        PointCloud.decode(message[: min(length, len(message) - 1)])


@given(st.lists(st.tuples(st.integers(0, 120), st.integers(0, 255)), min_size=1, max_size=3))
def test_a_cloud_with_changed_bytes_is_refused_or_read_but_nothing_else_is_raised(changes):
    message = bytearray(plain().message())  # the first 117 bytes describe the points, which follow
    for place, value in changes:
        message[place] = value
    try:
        cloud = PointCloud.decode(bytes(message))
        assert cloud.xyz().shape == (cloud.height, cloud.width, 3)
        assert len(cloud.without(np.ones((cloud.height, cloud.width), bool), dense=False)) == len(message)
    except MessageError as refusal:
        assert str(refusal)


@given(
    st.sampled_from([np.float32, np.float64]),
    st.lists(st.sampled_from(list(DATATYPES.values())), max_size=4),
    st.integers(0, 2**32),
)
def test_an_encoded_cloud_is_what_a_stranger_decodes(kind, extra, seed):
    rng = np.random.default_rng(seed)
    xyz = rng.normal(0, 1, (3, 5, 3)).astype(kind)
    fields = {f'f{i}': rng.integers(0, 100, (3, 5)).astype(code) for i, code in enumerate(extra)}
    cloud = DECODE(encode_point_cloud(Header(7, 8, 'cell'), xyz, fields))
    assert (cloud.header.stamp.sec, cloud.header.stamp.nanosec, cloud.header.frame_id) == (7, 8, 'cell')
    assert (cloud.height, cloud.width, cloud.is_bigendian, cloud.is_dense) == (3, 5, False, True)
    assert cloud.row_step == cloud.point_step * 5
    values = {'x': xyz[..., 0], 'y': xyz[..., 1], 'z': xyz[..., 2], **fields}
    assert [field.name for field in cloud.fields] == list(values)
    for field in cloud.fields:
        found = np.ndarray(
            (3, 5),
            '<' + DATATYPES[field.datatype],
            bytes(cloud.data),
            field.offset,
            (cloud.row_step, cloud.point_step),
        )
        np.testing.assert_array_equal(found, values[field.name])


def test_a_field_of_another_shape_cannot_be_encoded():
    with pytest.raises(MessageError, match=r"Field 'q' is \(2, 2\) float32; a cloud of 3 rows × 5 columns takes"):
        encode_point_cloud(Header(), np.zeros((3, 5, 3)), {'q': np.zeros((2, 2), np.float32)})


@pytest.mark.parametrize('kind', [np.float32, np.float64])
def test_what_is_masked_is_encoded_as_not_measured(kind):
    xyz = np.ma.masked_array(np.full((3, 5, 3), 7, kind), False)
    xyz[1, 2, 2] = np.ma.masked
    counts = np.ma.masked_array(np.ones((3, 5), np.uint8), False)
    whole = PointCloud.decode(encode_point_cloud(Header(), xyz, {'n': counts}))
    assert (whole.is_dense, whole.fields[3].datatype) == (False, 2)
    assert np.argwhere(np.isnan(whole.xyz())).tolist() == [[1, 2, 2]]
    counts[0, 4] = np.ma.masked
    again = PointCloud.decode(encode_point_cloud(Header(), xyz, {'n': counts}))
    assert np.argwhere(np.isnan(again.values('n'))).tolist() == [[0, 4]]


@pytest.mark.parametrize('xyz', [np.zeros((3, 5)), np.zeros((3, 5, 2)), np.zeros(3)])
def test_what_is_no_organized_cloud_cannot_be_encoded(xyz):
    with pytest.raises(MessageError, match=r'has the shape \(rows, columns, 3\), not'):
        encode_point_cloud(Header(), xyz)


@pytest.mark.parametrize('kind', np.typecodes['All'])
def test_coordinates_are_written_exactly_if_they_can_be_read(kind):
    """Of masked arrays, too: masked whole numbers become floats elsewhere."""
    xyz = np.ones((2, 3, 3)).astype(kind)
    swapped = xyz.astype(xyz.dtype.newbyteorder())
    masked = np.ma.masked_array(xyz, np.arange(18).reshape(xyz.shape) % 4 == 0)
    for cloud in (xyz, swapped, masked):
        if kind in 'fd':
            read = PointCloud.decode(encode_point_cloud(Header(), cloud)).xyz()
            assert read.dtype == kind
            np.testing.assert_array_equal(read, np.ma.filled(cloud, np.nan))
        else:
            with pytest.raises(MessageError, match='Coordinates must be float32 or float64, not '):
                encode_point_cloud(Header(), cloud)


@pytest.mark.parametrize('shape', [(0, 4, 3), (4, 0, 3)])
def test_a_cloud_without_a_point_cannot_be_encoded(shape):
    with pytest.raises(MessageError, match='The cloud needs a point; it has [04] rows × [04] columns'):
        encode_point_cloud(Header(), np.zeros(shape))


def test_rows_of_unlike_lengths_cannot_be_encoded():
    with pytest.raises(MessageError, match="Field 'f' is no array: its rows differ in their lengths"):
        encode_point_cloud(Header(), np.zeros((2, 2, 3)), {'f': [[1, 2], [3]]})
    with pytest.raises(MessageError, match='The cloud is no array: its rows differ in their lengths'):
        encode_point_cloud(Header(), [[1, 2], [3]])


@pytest.mark.parametrize('name', ['', 'a\0b', 'x', 'z'])
def test_a_field_without_a_name_of_its_own_cannot_be_encoded(name):
    with pytest.raises(MessageError, match='has no name of its own'):
        encode_point_cloud(Header(), np.zeros((3, 5, 3)), {name: np.zeros((3, 5), np.float32)})


@given(height=st.integers(1, 5), width=st.integers(1, 5), dense=st.booleans(), frame=st.text(max_size=9))
def test_a_cloud_written_in_place_is_that_which_is_encoded_from_arrays(height, width, dense, frame):
    values = np.random.default_rng(height).random((height, width, 4), np.float32)
    values[0, 0, 2] = 1 if dense else np.nan

    def fill(points):
        assert not points.any()
        points[:] = values
        return dense

    header = Header(3, 4, frame.replace('\0', ''))
    written = write_float_cloud(header, (height, width), ('x', 'y', 'z', 'w'), fill)
    assert written == encode_point_cloud(header, values[..., :3], {'w': values[..., 3]})
