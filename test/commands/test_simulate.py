# SPDX-License-Identifier: Apache-2.0
"""`socialcircle simulate`, and focus stacks through `import` and `filter`."""

import re
import shlex

import numpy as np
import pytest
from storage.disks import small_disk

from socialcircle_ros.messages.point_cloud import PointCloud
from socialcircle_ros.recording import open_recording


def contents(path):
    with open_recording(path) as reader:
        return {message.topic: message.data for message in reader.messages()}


def test_a_simulated_stack_is_filtered_with_the_parameters_beside_it(run, tmp_path):
    done = run('simulate', 'flat', '-o', 'flat.mcap', '--size', '40', '50', '--frames', '20', '--seed', '2')
    assert done.code == 0, done.err
    assert '20 frames of 40 rows × 50 columns' in done.out
    filtered = run('filter', 'flat.mcap', '--params-file', 'flat.yaml', '-o', 'cleaned.mcap')
    assert filtered.code == 0, filtered.err
    assert '1 focus stack measured; 1 cloud filtered, ' in filtered.out
    messages = contents(tmp_path / 'cleaned.mcap')
    depth = PointCloud.decode(messages['/stack/points']).xyz()[..., 2]
    truth = PointCloud.decode(messages['/truth/surface']).xyz()[..., 2]
    assert np.nanmedian(np.abs(depth - truth)) < 0.5e-6


def test_the_printed_command_works_as_it_stands_also_with_spaces_in_names(run, tmp_path):
    words = ('--size', '40', '50', '--frames', '20')
    done = run('simulate', 'flat', '-o', 'Meß daten/ü ber.mcap', *words)
    assert done.code == 0, done.err
    command = shlex.split(done.out.rpartition('Next: socialcircle ')[2])
    assert command[:4] == ['filter', 'Meß daten/ü ber.mcap', '--params-file', 'Meß daten/ü ber.yaml']
    assert run(*command).code == 0
    assert (tmp_path / 'cleaned.mcap').is_file()
    into_a_directory = run('simulate', 'flat', '-o', 'night.2026-11-29', *words)
    assert (
        'written to the directory night.2026-11-29, parameters to night.2026-11-29.yaml.' in into_a_directory.out
    )


def test_a_refusal_for_want_of_parameters_names_those_beside_the_recording(run, tmp_path):
    run('simulate', 'flat', '-o', 'my out/flat.mcap', '--size', '40', '50', '--frames', '20')
    filtered = run('filter', 'my out/flat.mcap', '-o', 'cleaned.mcap')
    told = "; my out/flat.yaml beside it has the parameters: --params-file 'my out/flat.yaml'"
    assert filtered.code == 1
    assert filtered.err.rstrip().endswith(f'the distance of two pixels on the part, in metres{told}')
    pytest.importorskip('matplotlib')
    reported = run('report', 'my out/flat.mcap')
    assert reported.code == 1
    assert told in reported.err
    (tmp_path / 'my out/flat.yaml').unlink()
    assert 'beside it' not in run('filter', 'my out/flat.mcap', '-o', 'other.mcap').err


def test_an_incomplete_stack_is_a_warning(run, tmp_path):
    run('simulate', 'flat', '-o', 'flat.mcap', '--size', '40', '50', '--frames', '20', '--seed', '2')
    given = ('flat.mcap', '--params-file', 'flat.yaml', '-p', 'stack.frames:=25')
    filtered = run('filter', *given, '-o', 'cleaned.mcap')
    assert filtered.code == 0, filtered.err
    assert 'Warning: A stack ended after 20 frames, where stack.frames says 25' in filtered.err
    pytest.importorskip('matplotlib')
    assert '1 measurement with warnings' in run('report', *given).err
    assert 'A stack ended after 20 frames' in (tmp_path / 'report.html').read_text()


def test_the_same_seed_gives_the_same_recording(run, tmp_path):
    for name in ('a', 'b'):
        run('simulate', 'pits', '-o', f'{name}.mcap', '--size', '30', '40', '--frames', '5', '--seed', '4')
    assert contents(tmp_path / 'a.mcap') == contents(tmp_path / 'b.mcap')


def test_an_imported_stack_needs_its_pitch_and_step(run, tmp_path):
    texture = np.random.default_rng(0).integers(-90, 90, (20, 30))
    frames = np.stack([128 + sharp * texture for sharp in (0.2, 0.6, 1.0, 0.6, 0.2)]).astype(np.uint8)
    np.savez(tmp_path / 's.npz', frames=frames, z=np.arange(5))
    refused = run('import', 's.npz', '-o', 's.mcap')
    assert refused.code == 1
    assert 'give --pitch and --z-step in metres' in refused.err
    done = run('import', 's.npz', '-o', 's.mcap', '--pitch', '2e-6', '--z-step', '1e-5')
    assert done.code == 0, done.err
    heads, first = (re.split('  +', line) for line in done.out.splitlines()[:2])
    assert dict(zip(heads, first, strict=True))['rows × columns'] == '20 × 30'
    filtered = run('filter', 's.mcap', '--params-file', 's.yaml', '-o', 'cleaned.mcap')
    assert '1 focus stack measured; ' in filtered.out
    assert PointCloud.decode(contents(tmp_path / 'cleaned.mcap')['/stack/points']).xyz()[0, 1, 0] == np.float32(
        2e-6
    )


@pytest.mark.parametrize(
    ('arguments', 'code', 'sentence'),
    [
        (['marble', '-o', 'x.mcap'], 1, 'marble'),
        (['flat', '-o', 'x.mcap', '--instrument', '1000x'], 1, "There is no instrument '1000x'"),
        (['flat', '-o', 'x.mcap', '--seed', '-1'], 2, 'must not be negative'),
        (['flat', '-o', '/proc/folder/x.mcap', '--frames', '3'], 1, '/proc/folder cannot be written'),
        (['flat', '-o', 'no/folder/x.png', '--frames', '3'], 1, 'x.png cannot be a recording'),
    ],
)
def test_an_error_is_one_sentence_and_leaves_no_file(run, tmp_path, arguments, code, sentence):
    done = run('simulate', *arguments)
    assert done.code == code
    assert sentence in done.err
    assert 'Traceback' not in done.err
    assert list(tmp_path.iterdir()) == []


GIVEN = ('simulate', 'flat', '-o', 'flat.mcap', '--size', '40', '50', '--frames', '20')


def test_parameters_that_are_there_are_only_replaced_on_request(run, tmp_path):
    (tmp_path / 'flat.yaml').write_text('tuned by hand')
    refused = run(*GIVEN)
    assert refused.code == 1
    assert 'flat.yaml, where the parameters of the stack in flat.mcap are written, exists already' in refused.err
    assert (tmp_path / 'flat.yaml').read_text() == 'tuned by hand'
    assert [path.name for path in tmp_path.iterdir()] == ['flat.yaml']
    assert run(*GIVEN, '--overwrite').code == 0
    assert 'stack.pitch_x' in (tmp_path / 'flat.yaml').read_text()


def test_there_are_no_parameters_without_their_recording(run, tmp_path):
    (tmp_path / 'flat.mcap').mkdir()
    refused = run(*GIVEN, '--overwrite')
    assert refused.code == 1
    assert 'flat.mcap is not a recording' in refused.err
    assert [path.name for path in tmp_path.iterdir()] == ['flat.mcap']


def test_a_full_disk_leaves_nothing_behind(run, tmp_path):
    frames = np.random.default_rng(0).integers(0, 255, (20, 300, 400), np.uint8)
    np.savez(tmp_path / 's.npz', frames=frames, z=np.arange(20))
    given = (tmp_path / 's.npz', '--pitch', '1e-6', '--z-step', '1e-6')
    with small_disk(tmp_path / 'disk', 1 << 20) as disk:
        done = run('import', *given, '-o', disk / 's.mcap')
        assert done.code == 1
        assert 's.mcap cannot be written (No space left on device)' in done.err
        assert 'Traceback' not in done.err
        assert list(disk.iterdir()) == []
