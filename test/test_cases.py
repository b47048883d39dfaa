# SPDX-License-Identifier: Apache-2.0
"""Inputs that used to go wrong, with the right answer for each.

The files are in `cases` beside the folder of real measurements; each is one example of a kind. More of each kind
are made here, and by the tests of the module that reads it.
"""

import os
import struct
from pathlib import Path

import numpy as np
import pytest
import zstandard
from examples import cloud, surface
from mcap.writer import CompressionType, IndexType, Writer

from socialcircle_ros.commands.main import main
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.diagnostics import Status
from socialcircle_ros.messages.image import Image
from socialcircle_ros.messages.joint_state import JointState
from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic, schema_text

CASES = Path(os.environ.get('SOCIALCIRCLE_DATA') or 'nowhere').parent / 'cases'
ATTACHMENT = ('calibration.yaml', 'text/yaml', b'pitch: 1e-6\n')


class Run:
    """Runs commands of `socialcircle` in a folder of its own."""

    def __init__(self, folder, capsys):
        self.folder, self._capsys = folder, capsys
        self.out = self.err = ''

    def __call__(self, *arguments):
        """Run a command; its exit code."""
        code = main([str(argument) for argument in arguments])
        self.out, self.err = self._capsys.readouterr()
        assert 'Traceback' not in self.err
        return code

    def messages(self, name):
        with open_recording(self.folder / name) as reader:
            return list(reader.messages())

    def imported(self, path, *options):
        """Import a file that must be taken; the messages."""
        assert self('import', path, '-o', self.folder / 'in.mcap', '--overwrite', *options) == 0, self.err
        return self.messages('in.mcap')

    def cloud(self, path, *options):
        """Import one cloud."""
        (message,) = self.imported(path, *options)
        return PointCloud.decode(message.data)

    def stack(self, path, *options):
        """Import a stack; the z of its frames in steps, and the frames."""
        options = options or ('--pitch', '1e-6', '--z-step', '1e-6')
        messages = self.imported(path, *options)
        z = [JointState.decode(m.data).positions[0] for m in messages if m.topic == '/stack/joint_states']
        frames = [Image.decode(m.data).pixels() for m in messages if m.topic == '/stack/image']
        assert len(self.out.splitlines()) >= len(frames) + 1
        return [round(place * 1e6, 3) for place in z], frames

    def filtered(self, path, *options):
        """Filter a recording; the exit code and the measurements."""
        code = self('filter', path, '-o', self.folder / 'out.mcap', '--overwrite', *options)
        if not (self.folder / 'out.mcap').exists():
            return code, []
        found = [m for m in self.messages('out.mcap') if m.topic.endswith('/social_circle/measurement')]
        return code, [Status.decode(message.data) for message in found]

    def assert_two_clouds(self, path):
        code, measurements = self.filtered(path)
        assert code == 0, self.err
        assert len(measurements) == 2
        assert '2 clouds filtered' in self.out


@pytest.fixture
def run(tmp_path, capsys):
    return Run(tmp_path, capsys)


@pytest.fixture
def case():
    """Gives the path of a case; without the folder of cases the test is skipped."""

    def path_of(name):
        if not CASES.is_dir():
            pytest.skip('the folder `cases` is not beside SOCIALCIRCLE_DATA')
        return CASES / name

    return path_of


def measured(message):
    return int(np.isfinite(message.xyz()).all(axis=-1).sum())


def field(message, name):
    (found,) = (one for one in message.fields if one.name == name)
    kind = np.dtype(point_cloud.DATATYPES[found.datatype])
    data = np.frombuffer(message.message, np.uint8)[message.data_start :][: message.data_length]
    points = data.reshape(message.height * message.width, message.point_step)
    return np.ascontiguousarray(points[:, found.offset : found.offset + kind.itemsize]).view(kind)[:, 0]


# Point files


def assert_grid(message):
    assert (message.height, message.width, measured(message)) == (5, 4, 19)


def test_c01_an_element_without_entries(run, case):
    assert_grid(run.cloud(case('c01_face0_ascii.ply')))


def test_c02_a_spelling_of_nan(run, case):
    assert_grid(run.cloud(case('c02_nan_ind.pcd')))


@pytest.mark.parametrize('text', ['-nan(ind)', 'nan(snan)', '1.#QNAN', '-1.#IND', 'NaN', '-nan'])
def test_c02_spellings_of_nan_in_a_ply(run, text):
    lines = '\n'.join(f'{i % 4} {i // 4} {text if i == 6 else 1}' for i in range(20))
    path = run.folder / 'a.ply'
    path.write_text(
        'ply\nformat ascii 1.0\nobj_info num_cols 4\nobj_info num_rows 5\nelement vertex 20\nproperty float x\n'
        f'property float y\nproperty float z\nend_header\n{lines}\n'
    )
    assert_grid(run.cloud(path))


def test_c03_a_field_that_is_there_twice(run, case):
    message = run.cloud(case('c03_duplicate_field.pcd'))
    assert_grid(message)
    assert [one.name for one in message.fields] == ['x', 'y', 'z', 'intensity', 'intensity_2']
    assert 'intensity is there again' in run.err


def test_c04_64_bit_numbers(run, case):
    message = run.cloud(case('c04_uint64_time.pcd'))
    assert_grid(message)
    found = field(message, 't_high').astype(object) * 2**32 + field(message, 't_low').astype(object)
    assert found.tolist() == [1726578368464684544 + i for i in range(20)]
    assert '64-bit whole numbers' in run.err


def test_c21_frames_in_another_byte_order(run, case):
    path = case('c21_big_endian.npz')
    _, frames = run.stack(path)
    with np.load(path) as archive:
        np.testing.assert_array_equal(frames, archive['frames'])


def test_c23_a_python_object_beside_the_numbers(run, case):
    path = case('c23_object_beside.npz')
    message = run.cloud(path)
    with np.load(path) as archive:
        np.testing.assert_array_equal(message.xyz()[..., 2], archive['z'] / 1e6)  # µm in m
    assert 'the array meta' in run.err


# Recordings


def write_clouds(path, *, kind=point_cloud.TYPE, count=2, pack=bytes, extras=False, **options):
    """A recording that mcap alone writes."""
    writer = Writer(str(path), compression=CompressionType.ZSTD, **options)
    writer.start('ros2', 'test')
    if extras:
        name, media_type, data = ATTACHMENT
        writer.add_attachment(0, 0, name, media_type, data)
        writer.add_metadata('site', {'cell': '7'})
    schema = writer.register_schema(kind, 'ros2msg', schema_text(point_cloud.TYPE).encode())
    channel = writer.register_channel('/points', 'cdr', schema)
    for number in range(count):
        writer.add_message(channel, number + 1, pack(cloud(stamp=number + 1)), number + 1)
    writer.finish()
    return path


@pytest.mark.parametrize(
    'name',
    [
        'c05_schemas_not_repeated.mcap',
        'c07_type_without_msg.mcap',
        'c09_message_compression',
        'c10_whole_file.mcap.zstd',
        'c11_row_step_of_the_whole.mcap',
    ],
)
def test_recordings_that_are_read(run, case, name):
    run.assert_two_clouds(case(name))


@pytest.mark.parametrize(
    'options',
    [
        {'repeat_schemas': False},
        {'repeat_channels': False},
        {'repeat_schemas': False, 'repeat_channels': False, 'use_statistics': False},
        {'use_statistics': False},
        {'index_types': IndexType.NONE},
        {'index_types': IndexType.CHUNK},
        {'use_chunking': False},
    ],
)
def test_c05_indexes_that_lack_something(run, options):
    run.assert_two_clouds(write_clouds(run.folder / 'a.mcap', **options))


def test_c06_attachments_and_metadata_records_are_kept(run, case):
    path = case('c06_attachment_and_metadata.mcap')
    run.assert_two_clouds(path)
    with open_recording(path) as before, open_recording(run.folder / 'out.mcap') as after:
        assert list(after.attachments()) == list(before.attachments()) != []
        assert list(after.metadata()) == list(before.metadata()) != []


@pytest.mark.parametrize('options', [{}, {'index_types': IndexType.NONE}, {'use_chunking': False}])
@pytest.mark.parametrize('target', ['out.mcap', 'bag'])
def test_c06_attachments_are_kept_however_they_are_indexed(run, options, target):
    path = write_clouds(run.folder / 'a.mcap', extras=True, **options)
    assert run('filter', path, '-o', run.folder / target) == 0
    with open_recording(run.folder / target) as after:
        assert [(one.name, one.media_type, one.data) for one in after.attachments()] == [ATTACHMENT]
        assert [(record.name, record.entries) for record in after.metadata()] == [('site', {'cell': '7'})]


def test_c08_an_unknown_compression_is_named(run, case):
    code, _ = run.filtered(case('c08_unknown_compression.mcap'))
    assert code == 1
    assert "a chunk has the unknown compression 'brot'" in run.err
    assert not (run.folder / 'out.mcap').exists()


def test_c09_messages_that_are_compressed_one_by_one_without_the_metadata(run):
    run.assert_two_clouds(write_clouds(run.folder / 'a.mcap', pack=zstandard.compress))


@pytest.mark.parametrize('kind', [point_cloud.TYPE, 'sensor_msgs/PointCloud2'])
def test_a_topic_of_two_types_that_does_not_concern_us_refuses_nothing(run, kind):
    path = run.folder / 'a.mcap'
    writer = Writer(str(path))
    writer.start('ros2', 'test')
    for number, (name, type_) in enumerate(
        [('/points', kind), ('/log', 'a/msg/A'), ('/log', 'a/msg/B'), ('/j', 'j')]
    ):
        schema = writer.register_schema(type_, 'ros2msg', b'')
        channel = writer.register_channel(name, 'json' if name == '/j' else 'cdr', schema)
        writer.add_message(channel, number + 1, cloud(stamp=number + 1) if name == '/points' else b'x', number + 1)
    writer.finish()
    code, measurements = run.filtered(path)
    assert (code, len(measurements)) == (0, 1), run.err
    with open_recording(run.folder / 'out.mcap') as reader:
        assert [reader.topics[name].type for name in ('/log', '/log#2', '/j')] == ['a/msg/A', 'a/msg/B', 'j']
        assert [message.data for message in reader.messages(['/log', '/log#2', '/j'])] == [b'x'] * 3


@pytest.mark.parametrize('name', ['gz', 'lz4', 'xz'])
def test_c10_other_compressions_of_a_file_are_named(run, name):
    magic = {'gz': b'\x1f\x8b\x08', 'lz4': struct.pack('<I', 0x184D2204), 'xz': b'\xfd7zXZ\0'}[name]
    (run.folder / 'a.mcap').write_bytes(magic + bytes(100))
    assert run.filtered(run.folder / 'a.mcap')[0] == 1
    assert 'is compressed with' in run.err


@pytest.mark.parametrize('mode', ['adaptive', 'paper'])
def test_c12_zeros_for_not_measured(run, case, mode):
    code, (measurement, *_) = run.filtered(case('c12_zeros_for_not_measured.mcap'), '-p', f'circle.mode:={mode}')
    assert code == 0, run.err
    outliers, total = int(measurement.values['outliers']), int(measurement.values['measured'])
    assert outliers < 100
    assert total <= 60_000 - 16_000
    assert '16000 points are exactly at (0, 0, 0) and count as not measured' in run.err


# Parameter files


def recording(run):
    path = run.folder / 'cell.mcap'
    with RecordingWriter(path, overwrite=True) as writer:
        writer.add_topic(ros_topic('/cell1/points', point_cloud.TYPE))
        writer.write('/cell1/points', cloud(), 1)
    return path


@pytest.mark.parametrize('name', ['c13_nested_namespace.yaml', 'c14_other_nodes_too.yaml'])
def test_sections_of_a_parameter_file(run, case, name):
    code, (measurement,) = run.filtered(recording(run), '--params-file', case(name))
    assert code == 0, run.err
    assert float(measurement.values['circle.radius_scale']) == 1.5


@pytest.mark.parametrize(
    ('text', 'scale'),
    [
        ('/cell1/social_circle: {N: 1.5}\n/cell2/social_circle: {N: 2.5}', 1.5),
        ('/**: {N: 1.5}\n/cell2/social_circle: {N: 2.5}', 1.5),
        ('/**: {N: 2.5}\ncell1: {social_circle: {N: 1.5}}', 1.5),
        ('cell1: {social_circle: {N: 2.5}}\n/**: {N: 1.5}', 1.5),
        ('rviz: {N: 2.5}\n"*": {social_circle: {N: 1.5}, other: {N: 3.5}}', 1.5),
        ('/cell2/social_circle: {N: 2.5}', 2.5),
    ],
)
def test_c13_c14_sections_apply_to_the_node_of_the_recorded_namespace(run, text, scale):
    path = run.folder / 'cell.yaml'
    path.write_text(text.replace('{N: ', '{ros__parameters: {circle.radius_scale: ').replace('5}', '5}}'))
    code, (measurement,) = run.filtered(recording(run), '--params-file', path)
    assert code == 0, run.err
    assert float(measurement.values['circle.radius_scale']) == scale


def test_c15_a_number_in_quotes(run, case):
    code, _ = run.filtered(recording(run), '--params-file', case('c15_number_in_quotes.yaml'))
    assert code == 1
    assert (
        "c15_number_in_quotes.yaml: circle.radius_scale must be a number, not '1.5': write it without" in run.err
    )


# Frames


def test_c16_negative_z(run, case):
    z, frames = run.stack(case('c16_negative_z'))
    assert z == list(range(-6, 6))
    assert len(frames) == 12


def test_c17_a_frame_is_missing(run, case):
    z, _ = run.stack(case('c17_frame_missing'))
    assert z == [0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11]
    assert '1 frame missing between f3.png and f5.png' in run.err


def test_c18_hidden_files(run, case):
    z, _ = run.stack(case('c18_hidden_files'))
    assert z == list(range(12))
    assert 'hidden files are passed over: 12' in run.err


@pytest.mark.parametrize(
    ('name', 'sentence'),
    [
        ('c19_float_tiff', r'real numbers of 32 bits'),
        (
            'c22_two_depths',
            r'f06.tif is 48 rows × 64 columns gray, 16 bits, but f00.tif is 48 rows',
        ),
    ],
)
def test_frames_that_are_refused(run, case, name, sentence):
    path = case(name)
    assert run('import', path, '-o', run.folder / 'in.mcap', '--pitch', '1e-6', '--z-step', '1e-6') == 1
    assert sentence in run.err
    assert not list(run.folder.iterdir())


def test_c20_a_tiff_with_pages(run, case):
    z, frames = run.stack(case('c20_multipage.tif'))
    assert z == list(range(12))
    _, single = run.stack(case('c18_hidden_files'))
    np.testing.assert_array_equal(frames, single)


@pytest.fixture
def images(run):
    """Writes the 12 frames of a tilted plane under given names."""
    pillow = pytest.importorskip('PIL.Image')
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 255, (48, 64)).astype(np.float32)
    smooth = texture.copy()
    for axis in (0, 1):
        smooth = (np.roll(smooth, 2, axis) + np.roll(smooth, -2, axis) + smooth) / 3
    distance = np.arange(12)[:, None, None] - np.linspace(0, 11, 64)
    sharp = np.exp(-(distance**2) / 4)
    pixels = (sharp * texture + (1 - sharp) * smooth).astype(np.uint8)

    def write(names, change=lambda image: image):
        folder = run.folder / 'frames'
        folder.mkdir(exist_ok=True)
        for name, frame in zip(names, pixels, strict=True):
            change(pillow.fromarray(frame)).save(folder / name)
        return folder, pixels

    return write


@pytest.mark.parametrize(
    ('names', 'z'),
    [
        ([f'z{z:+.1f}.png' for z in range(-6, 6)], list(range(-6, 6))),
        ([f'part_{z}.png' for z in range(-6, 6)], list(range(-6, 6))),
        ([f'{n + 9}.png' for n in range(12)], list(range(12))),
        ([f'img-{n:02}.png' for n in range(12)], list(range(12))),
        ([f'f{n + (n > 4) + 2 * (n > 8)}.tif' for n in range(12)], [0, 1, 2, 3, 4, 6, 7, 8, 9, 12, 13, 14]),
    ],
)
def test_order_and_z_of_more_names(run, images, names, z):
    folder, pixels = images(names)
    found, frames = run.stack(folder)
    assert found == z
    np.testing.assert_array_equal(frames, pixels)


def test_z_with_a_unit_in_the_names_needs_no_step(run, images):
    folder, _ = images([f's_z{0.5 * n:.1f}um.png' for n in range(12)])
    z, _ = run.stack(folder, '--pitch', '1e-6')
    assert z == [0.5 * n for n in range(12)]
    assert run('import', folder, '-o', run.folder / 'x.mcap', '--pitch', '1e-6', '--z-step', '1e-6') == 1
    assert 'says z itself' in run.err


@pytest.mark.parametrize(
    ('options', 'z'), [(('--z-from', 'order'), list(range(12))), (('--z-from', 'name'), list(range(-12, 0)))]
)
def test_doubts_are_settled_by_an_option(run, images, options, z):
    folder, pixels = images([f'z-{n + 1}.png' for n in range(12)])
    lengths = ('--pitch', '1e-6', '--z-step', '1e-6')
    assert run('import', folder, '-o', run.folder / 'x.mcap', *lengths) == 1
    assert '--z-from name if it is a sign, or --z-from order' in run.err
    found, frames = run.stack(folder, *lengths, *options)
    assert found == z
    np.testing.assert_array_equal(frames, pixels if options[1] == 'order' else pixels[::-1])


@pytest.mark.parametrize(
    ('name', 'sentence'),
    [
        ('f12.png', 'f12.png is in focus everywhere'),
        ('all.png', 'all.png is passed over'),
        ('f12.tif', 'f12.tif is 48 rows × 32'),
        ('f12.bmp', 'f12.bmp has only 2 gray values'),
        ('f12.jpg', 'f12.jpg is 48 rows × 64 columns RGB'),
    ],
)
def test_what_does_not_belong_is_told_or_refused(run, images, name, sentence):
    folder, pixels = images([f'f{n}.png' for n in range(12)])
    from PIL import Image as Pillow

    best = np.rint(np.linspace(0, 11, 64)).astype(int)
    focused = Pillow.fromarray(np.take_along_axis(pixels, best[None, None, :].repeat(48, 1), 0)[0])
    other = {'tif': focused.crop((0, 0, 32, 48)), 'bmp': focused.point(lambda v: 255 * (v > 99)),
             'jpg': focused.convert('RGB')}.get(name[-3:], focused)  # fmt: skip
    other.save(folder / name)
    code = run('import', folder, '-o', run.folder / 'x.mcap', '--pitch', '1e-6', '--z-step', '1e-6')
    assert sentence in run.err
    assert code == ('passed over' not in sentence)


@pytest.mark.parametrize('kind', ['f4', 'i4'])
def test_c19_whole_numbers_of_32_bits_are_converted_without_loss(run, images, kind):
    from PIL import Image as Pillow

    folder, pixels = images(
        [f'f{n}.tif' for n in range(12)], lambda image: Pillow.fromarray(np.asarray(image).astype(kind))
    )
    np.testing.assert_array_equal(run.stack(folder)[1], pixels)


def test_c23_own_coordinates_of_an_archive(run):
    x, y = np.arange(80) ** 1.5, np.arange(70) * 2.0
    np.savez(run.folder / 'a.npz', z=surface()[..., 2], x=x, y=y, meta=np.array({'a': 1}, dtype=object))
    xyz = run.cloud(run.folder / 'a.npz').xyz()
    np.testing.assert_array_equal(xyz[0, :, 0], x / 1e6)
    np.testing.assert_array_equal(xyz[:, 0, 1], y / 1e6)
