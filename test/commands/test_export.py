# SPDX-License-Identifier: Apache-2.0
"""`socialcircle export`, `info`, and `filter` into a file."""

import numpy as np
import pytest

from socialcircle_ros.formats import MeasuredSurface, read_file, write_surface

pytest.importorskip('PIL', reason='needs Pillow: pip install Pillow')


def save(path, unit='m'):
    heights = np.random.default_rng(0).normal(0, 1e-8, (20, 30))
    heights[5, 7] = 1e-4
    write_surface(path, MeasuredSurface(heights, (5e-7, 5e-7), unit))


def test_from_a_file_to_a_cleaned_file_in_one_step(run, tmp_path):
    save(tmp_path / 'part.sdf')
    done = run('filter', 'part.sdf', '-o', 'part.x3p')
    assert done.code == 0, done.err
    assert '1 cloud filtered, 1 of 600 measured points are outliers' in done.out
    assert np.isnan(read_file(tmp_path / 'part.x3p').heights[5, 7])
    again = run('filter', 'part.sdf', '-o', 'part.x3p')
    assert again.code == 1
    assert 'part.x3p exists already' in again.err
    assert not list(tmp_path.glob('*.png'))  # docs/formats.md: only export writes the mask beside a file
    into_a_folder = run('filter', 'part.sdf', '-o', 'new/part.x3p')
    assert into_a_folder.code == 0, into_a_folder.err
    assert (tmp_path / 'new/part.x3p').is_file()


def test_what_a_format_does_not_hold_is_told(run, tmp_path):
    save(tmp_path / 'part.npz', unit='um')
    done = run('filter', 'part.npz', '-o', 'part.tiff')
    assert done.code == 0, done.err
    assert 'Note: .tiff holds float32: the heights are rounded from float64.' in done.err


def test_a_recording_is_exported_and_described(run, tmp_path):
    save(tmp_path / 'part.sdf')
    assert run('filter', 'part.sdf', '-o', 'c.mcap').code == 0
    done = run('export', 'c.mcap', '-o', 'out', '--format', 'x3p')
    assert done.code == 0, done.err
    assert '2 files written to out.' in done.out
    described = run('info', 'c.mcap', 'out/points_filtered_0000.x3p')
    assert (
        '/points_filtered  sensor_msgs/msg/PointCloud2  1, 20 rows × 30 columns (x, y, z), in m' in described.out
    )
    assert 'pitch     500 × 500 nm (x × y)' in described.out


def test_an_error_is_one_sentence(run, tmp_path):
    save(tmp_path / 'part.sdf')
    for arguments, sentence in (
        (['export', 'nowhere.mcap', '-o', 'out'], 'nowhere.mcap does not exist'),
        (['export', 'part.sdf', '-o', 'out', '--unit', 'furlong'], "'furlong' is not known"),
        (['filter', 'part.sdf', '-o', 'part.al3d'], 'its suffix must be .mcap or one of'),
        (['info', 'nowhere.x3p'], 'nowhere.x3p does not exist'),
    ):
        done = run(*arguments)
        assert done.code == 1
        assert sentence in done.err
        assert 'Traceback' not in done.err


def test_heights_without_a_pitch_are_imported_with_the_pitch_that_is_given(run, tmp_path):
    np.save(tmp_path / 'a.npy', np.eye(4))
    refused = run('import', 'a.npy', '-o', 'a.mcap')
    assert refused.code == 1
    assert 'does not state its pitch' in refused.err
    done = run('import', 'a.npy', '-o', 'a.mcap', '--pitch', '2', '--unit', 'um')
    assert done.code == 0, done.err
    assert 'a.npy (µm, given): 4 rows × 4 columns' in done.out
    assert '4 rows × 4 columns (x, y, z), in m' in run('info', 'a.mcap').out


def test_info_shows_every_file_also_after_one_that_cannot_be_read(run, tmp_path):
    save(tmp_path / 'a.x3p')
    save(tmp_path / 'b.x3p')
    (tmp_path / 'cut.x3p').write_bytes((tmp_path / 'a.x3p').read_bytes()[:100])
    done = run('info', 'a.x3p', 'nowhere.x3p', 'cut.x3p', 'b.x3p')
    assert done.code == 1
    assert [line for line in done.out.splitlines() if line.endswith('file')] == [
        'a.x3p: ISO 25178-72 file', 'b.x3p: ISO 25178-72 file',
    ]  # fmt: skip
    assert 'Error: nowhere.x3p does not exist' in done.err
    assert 'Error: cut.x3p' in done.err
    assert run('info', 'nowhere.x3p', 'a.x3p').out.startswith('a.x3p')
