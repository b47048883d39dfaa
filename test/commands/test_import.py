# SPDX-License-Identifier: Apache-2.0
"""`socialcircle import`."""

import numpy as np
import pytest

from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import open_recording


def save(path, **changes):
    rng = np.random.default_rng(0)
    np.savez(path, **({'z': rng.random((5, 7)), 'dx': 2.0, 'dy': 3.0, 'texture': rng.random((5, 7))} | changes))


def test_height_maps_become_clouds_in_the_given_order(run, tmp_path):
    for name in ('a', 'b'):
        save(tmp_path / f'{name}.npz')
    done = run('import', 'b.npz', 'a.npz', '-o', 'parts.mcap', '--topic', '/cell/points', '--period', '0.5')
    assert done.code == 0, done.err
    with open_recording(tmp_path / 'parts.mcap') as reader:
        messages = list(reader.messages())
    assert [message.topic for message in messages] == ['/cell/points'] * 2
    assert messages[1].log_time - messages[0].log_time == 500_000_000
    cloud = PointCloud.decode(messages[0].data)
    assert cloud.xyz()[4, 6, :2].tolist() == [12e-6, 12e-6]
    assert [field.name for field in cloud.fields] == ['x', 'y', 'z', 'texture']


@pytest.mark.parametrize(
    ('arguments', 'code', 'sentence'),
    [
        (['nowhere.npz', '-o', 'x.mcap'], 1, 'nowhere.npz does not exist'),
        (['notes.doc', '-o', 'x.mcap'], 1, 'notes.doc has an unknown file type'),
        (['frames', '-o', 'x.mcap'], 1, 'frames does not exist'),
        (['cut.npz', '-o', 'x.mcap'], 1, 'cut.npz is not an .npz archive'),
        (['good.npz', '-o', 'x.mcap', '--period', '0'], 2, 'must be above 0'),
        (
            ['good.npz', '-o', 'x.mcap', '--pitch', '1e-6'],
            1,
            'good.npz states its own coordinates: leave the pitch out',
        ),
        (['good.npz', '-o', 'x.mcap', '--order', 'time'], 1, '--order are for focus stacks'),
        (['nowhere.npz', '-o', 'x.mcap', '--pitch', '1e-6'], 1, 'nowhere.npz does not exist'),
        (['-o', 'x.mcap'], 2, 'Missing argument'),
    ],
)
def test_an_error_is_one_sentence_and_leaves_no_recording(run, tmp_path, arguments, code, sentence):
    save(tmp_path / 'good.npz')
    (tmp_path / 'cut.npz').write_bytes((tmp_path / 'good.npz').read_bytes()[:99])
    (tmp_path / 'notes.doc').write_text('hello')
    done = run('import', *arguments)
    assert done.code == code
    assert sentence in done.err
    assert 'Traceback' not in done.err
    assert not (tmp_path / 'x.mcap').exists()


def test_heights_of_an_archive_take_their_pitch_and_unit_from_the_options(run, tmp_path):
    np.savez(tmp_path / 'bare.npz', z=np.random.default_rng(0).random((5, 7)))
    done = run('import', 'bare.npz', '-o', 'x.mcap')
    assert done.code == 1
    assert 'bare.npz does not state its pitch: give it with its unit, as import --pitch 2 --unit um' in done.err
    done = run('import', 'bare.npz', '-o', 'x.mcap', '--pitch', '2', '--unit', 'nm')
    assert done.code == 0, done.err
    with open_recording(tmp_path / 'x.mcap') as reader:
        cloud = PointCloud.decode(next(iter(reader.messages())).data)
    assert cloud.xyz()[4, 6, :2].tolist() == [12e-9, 8e-9]


@pytest.mark.parametrize(
    ('pitch', 'step', 'told', 'warned'),
    [
        ('1e-6', '5e-6', 'pitch 1 µm, step 5 µm', []),
        ('1', '5', 'pitch 1 m, step 5 m', [('pitch', '1 m', '--pitch'), ('step', '5 m', '--z-step')]),
    ],
)
def test_the_lengths_of_a_stack_are_told_and_doubted(run, tmp_path, pitch, step, told, warned):
    np.savez(tmp_path / 'stack.npz', frames=np.zeros((4, 20, 30), np.uint8), z=np.arange(4.0))
    done = run('import', 'stack.npz', '-o', 'stack.mcap', '--pitch', pitch, '--z-step', step)
    assert done.code == 0, done.err
    assert told in done.out.splitlines()
    assert [line for line in done.err.splitlines() if line.startswith('Warning')] == [
        f'Warning: the {name} is {length}, and that of a microscope is below 1 mm; lengths are in m, so that'
        f' {option} 1e-6 is 1 µm.'
        for name, length, option in warned
    ]
