# SPDX-License-Identifier: Apache-2.0
"""The task of a worker: one input in, results out; no Dask here."""

import os
import resource
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
import yaml
from archive.archives import BAGS, NOON, all_is_there, in_between, recorded
from examples import cloud, surface

from socialcircle_ros.archive import NamePattern, find_inputs, work
from socialcircle_ros.archive.ledger import Ledger
from socialcircle_ros.archive.work import BatchTask, do_task
from socialcircle_ros.errors import UnitWarning
from socialcircle_ros.formats import MeasuredSurface, write_surface
from socialcircle_ros.kernels import bands
from socialcircle_ros.measurements import open_measurements
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.create import record_clouds
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.settings import PipelineSettings

pytest.importorskip('pyarrow')
pytest.importorskip('duckdb')


@pytest.fixture(autouse=True)
def threads_of_kernels():
    before = bands.limit
    yield
    bands.limit = before


def task(path, output, *, owners=None, **changes):
    (found,) = find_inputs([path], owners=owners)
    values = {
        'settings': PipelineSettings(), 'names': NamePattern(), 'topics': (), 'recordings': True, 'reports': False,
        'compression': 'none', 'version': '1', 'digest': 'abc',
    }  # fmt: skip
    return BatchTask(found, output, **{**values, **changes})


def asked(output, query='select recording, cell, part, number, outliers, status from measurements order by all'):
    return open_measurements(output).sql(query).fetchall()


def test_it_writes_what_filter_writes_and_a_row_for_each_cloud(tmp_path):
    path = recorded(tmp_path / 'a.mcap')
    result = do_task(task(path, tmp_path / 'out'))
    assert (result.entry.clouds, result.entry.failure, result.same_as) == (2, None, '')
    (tmp_path / 'same').mkdir()
    filter_recording(path, tmp_path / 'same/a.mcap', PipelineSettings())
    assert (tmp_path / 'out/recordings/a.mcap').read_bytes() == (tmp_path / 'same/a.mcap').read_bytes()
    assert asked(tmp_path / 'out') == [(str(path), 'cell1', None, number, 26, 'ok') for number in range(2)]
    ((sa, sq, sz),) = asked(tmp_path / 'out', 'select sa, sq, sz from measurements where number = 0')
    assert 0 < sa < sq < sz < 3


def test_a_row_has_the_unit_of_its_lengths(tmp_path):
    for name, unit in (('a', 'um'), ('b', 'mm')):
        np.savez(tmp_path / f'{name}.npz', z=surface(seed=ord(name))[..., 2], dx=1.0, dy=1.0, unit=unit)
    record_clouds([tmp_path / 'a.npz'], tmp_path / 'metres.mcap')
    record_clouds([tmp_path / 'b.npz'], tmp_path / 'kept.mcap', keep_unit=True)
    recorded(tmp_path / 'unknown.mcap', clouds=1, namespace='')
    for name in ('a.npz', 'b.npz', 'metres.mcap', 'kept.mcap', 'unknown.mcap'):
        do_task(task(tmp_path / name, tmp_path / 'out', digest=name, recordings=False))
    query = 'select parse_filename(recording), unit, round(log10(sq)) from measurements order by all'
    assert asked(tmp_path / 'out', query) == [
        ('a.npz', 'm', -6), ('b.npz', 'm', -3), ('kept.mcap', 'mm', 0), ('metres.mcap', 'm', -6),
        ('unknown.mcap', None, 0),
    ]  # fmt: skip


def test_units_are_told_whatever_other_threads_do_with_warnings(tmp_path, monkeypatch, recwarn):
    """They all share the filters of the process, and the place where warnings go."""
    path = tmp_path / 'a.npz'
    np.savez(path, z=surface()[..., 2], dx=1.0, dy=1.0)
    measured = work._measured

    def amid_others(*arguments, **options):
        with ThreadPoolExecutor(1) as other, warnings.catch_warnings():
            other.submit(warnings.simplefilter, 'ignore').result()
            return measured(*arguments, **options)

    monkeypatch.setattr(work, '_measured', amid_others)
    result = do_task(task(path, tmp_path / 'out', recordings=False))
    assert result.units == (f'{path} does not state its unit: taken as µm; import --unit names it.',)
    assert not [warning for warning in recwarn if issubclass(warning.category, UnitWarning)]


def test_a_row_has_the_time_of_its_measurement_file(tmp_path):
    """That which the file states, or else its last change; an import keeps both of each file."""
    heights = surface()[..., 2]
    stamp = f'{NOON // 10**9}.000000000'
    write_surface(tmp_path / 'a.npz', MeasuredSurface(heights, (1.0, 1.0), 'um', {}, {'stamp': stamp}))
    write_surface(tmp_path / 'b.npz', MeasuredSurface(heights + 1, (1.0, 1.0), 'um'))
    for name in 'ab':
        os.utime(tmp_path / f'{name}.npz', (1_800_000_000, 1_800_000_000))
    record_clouds([tmp_path / 'a.npz', tmp_path / 'b.npz'], tmp_path / 'both.mcap')
    for name in ('a.npz', 'b.npz', 'both.mcap'):
        do_task(task(tmp_path / name, tmp_path / 'out', recordings=False))
    query = (
        'select parse_filename(recording), number, epoch(time)::bigint, day::text from measurements order by all'
    )
    stated, changed = (NOON // 10**9, '2026-09-21'), (1_800_000_000, '2027-01-15')
    rows = [('a.npz', 0, *stated), ('b.npz', 0, *changed), ('both.mcap', 0, *stated), ('both.mcap', 1, *changed)]
    assert asked(tmp_path / 'out', query) == rows
    (tmp_path / 'b.npz').touch()  # its content is done
    do_task(task(tmp_path / 'b.npz', tmp_path / 'out', recordings=False))
    assert asked(tmp_path / 'out', query) == rows


def test_a_recording_without_dates_has_the_time_of_its_last_change(tmp_path):
    with RecordingWriter(tmp_path / 'a.mcap') as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        writer.write('/points', cloud(stamp=5_000_000_000), 5_000_000_000)
    os.utime(tmp_path / 'a.mcap', (1_800_000_000, 1_800_000_000))
    do_task(task(tmp_path / 'a.mcap', tmp_path / 'out', recordings=False))
    assert asked(tmp_path / 'out', 'select epoch(time)::bigint from measurements') == [(1_800_000_000,)]


def test_the_cloud_of_a_stack_is_in_metres(tmp_path):
    values = yaml.safe_load((BAGS / 'stack.yaml').read_text())['/**']['ros__parameters']
    do_task(task(BAGS / 'stack.mcap', tmp_path / 'out', settings=PipelineSettings.from_ros(values)))
    assert asked(tmp_path / 'out', 'select topic, unit from measurements') == [('/stack/points', 'm')]


def test_cell_and_part_come_from_the_name_then_from_the_metadata_then_from_the_namespace(tmp_path):
    path = recorded(tmp_path / 'line2/lid_1.mcap', clouds=1, metadata={'cell': 'hall', 'part': 'box'})
    bare = recorded(tmp_path / 'bare.mcap', clouds=1, namespace='', seed=1)
    do_task(task(path, tmp_path / 'out'))
    do_task(task(bare, tmp_path / 'out'))
    assert sorted(row[1:3] for row in asked(tmp_path / 'out')) == [('hall', 'box'), ('unnamed', None)]
    do_task(task(path, tmp_path / 'out', names=NamePattern('{cell}/{part}_*.mcap'), digest='other'))
    assert sorted(row[1:3] for row in asked(tmp_path / 'out')) == [('line2', 'lid'), ('unnamed', None)]


def test_without_recordings_the_rows_are_the_same(tmp_path):
    path = recorded(tmp_path / 'a.mcap')
    query = 'select number, stamp, outliers, radius, sa, sq, sz, seed_row, topic from measurements order by number'
    rows = []
    for recordings in (True, False):
        output = tmp_path / str(recordings)
        do_task(task(path, output, recordings=recordings))
        rows.append(asked(output, query))
    assert rows[0] == rows[1]
    assert not (tmp_path / 'False/recordings').exists()


def test_what_is_done_is_not_done_again_and_other_settings_replace_the_rows(tmp_path):
    path = recorded(tmp_path / 'a.mcap')
    do_task(task(path, tmp_path / 'out'))
    made = (tmp_path / 'out/recordings/a.mcap').stat().st_mtime_ns
    do_task(task(path, tmp_path / 'out'))
    assert (tmp_path / 'out/recordings/a.mcap').stat().st_mtime_ns == made
    do_task(task(path, tmp_path / 'out', digest='other'))
    assert (tmp_path / 'out/recordings/a.mcap').stat().st_mtime_ns > made
    assert len(asked(tmp_path / 'out')) == 2


def test_an_interrupted_run_with_other_settings_leaves_nothing_that_counts_as_done(tmp_path, monkeypatch):
    path, out = recorded(tmp_path / 'a.mcap'), tmp_path / 'out'
    do_task(task(path, out))
    before = (out / 'recordings/a.mcap').read_bytes()
    limited = PipelineSettings.from_ros({'limits.outlier_share_max': 0.01})

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr('socialcircle_ros.archive.work.write_rows', interrupted)
        do_task(task(path, out, settings=limited, digest='limited'))
    assert (out / 'recordings/a.mcap').read_bytes() != before
    assert do_task(task(path, out)).same_as == ''
    assert (out / 'recordings/a.mcap').read_bytes() == before


def test_a_copy_of_a_recording_is_not_measured_twice(tmp_path):
    path = recorded(tmp_path / 'a.mcap')
    (tmp_path / 'b.mcap').write_bytes(path.read_bytes())
    do_task(task(path, tmp_path / 'out'))
    assert do_task(task(tmp_path / 'b.mcap', tmp_path / 'out')).same_as == str(path)
    assert len(asked(tmp_path / 'out')) == 2


def test_a_damaged_recording_gives_the_clouds_before_the_damage(tmp_path):
    content = recorded(tmp_path / 'whole.mcap', clouds=3).read_bytes()
    path = tmp_path / 'cut.mcap'
    path.write_bytes(content[: len(content) // 2])
    entry = do_task(task(path, tmp_path / 'out')).entry
    assert entry.clouds == 1
    assert 'cut.mcap is damaged' in entry.damage
    assert len(asked(tmp_path / 'out')) == 1


def test_what_fails_is_a_row_and_success_removes_it(tmp_path):
    path = tmp_path / 'a.mcap'
    path.write_bytes(b'no recording')
    entry = do_task(task(path, tmp_path / 'out', names=NamePattern('{part}.mcap'))).entry
    assert 'a.mcap' in entry.failure
    assert asked(tmp_path / 'out') == [(str(path), 'unnamed', 'a', None, None, 'failed')]
    assert not list((tmp_path / 'out').glob('recordings/*'))
    path.unlink()
    recorded(path)
    do_task(task(path, tmp_path / 'out'))
    assert [row[-1] for row in asked(tmp_path / 'out')] == ['ok', 'ok']
    assert [each.name[:6] for each in (tmp_path / 'out/inputs').iterdir()] != ['failed']


def entries_at(output, path):
    return tuple(entry for entry in Ledger(output).entries() if entry.location == str(path))


def again(path, output, **changes):
    """The task that a further run makes of an input."""
    return do_task(task(path, output, earlier=entries_at(output, path), **changes))


def test_a_recording_that_grows_is_measured_once(tmp_path):
    path, out = tmp_path / 'a.mcap', tmp_path / 'out'
    content = recorded(tmp_path / 'whole.mcap', clouds=3).read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert again(path, out).entry.damage
    path.write_bytes(content)
    again(path, out)
    assert [row[-1] for row in asked(out)] == ['ok'] * 3
    assert [entry.damage for entry in Ledger(out).entries()] == [None]


def test_what_a_location_held_before_is_gone_when_it_fails_but_not_while_it_cannot_be_read(tmp_path):
    path, out = recorded(tmp_path / 'a.mcap'), tmp_path / 'out'
    again(path, out)
    before = task(path, out, earlier=entries_at(out, path))
    path.rename(tmp_path / 'away')  # as on a drive that is not mounted
    assert do_task(before).entry.failure
    assert sorted(row[-1] for row in asked(out)) == ['failed', 'ok', 'ok']
    path.write_bytes(b'half a re')
    assert again(path, out).entry.failure
    assert [row[-1] for row in asked(out)] == ['failed']


def test_a_copy_takes_the_place_of_what_its_location_held_and_of_its_failure(tmp_path):
    path, copy, out = recorded(tmp_path / 'a.mcap'), tmp_path / 'b.mcap', tmp_path / 'out'
    again(path, out)
    again(recorded(copy, seed=1), out)
    copy.write_bytes(path.read_bytes()[:200])
    assert again(copy, out).entry.failure
    copy.write_bytes(path.read_bytes())
    assert again(copy, out).same_as == str(path)
    assert {row[0] for row in asked(out)} == {str(path)}


def test_a_recording_that_is_moved_is_measured_at_its_new_place(tmp_path):
    path, out = recorded(tmp_path / 'cell1/a.mcap'), tmp_path / 'out'
    (tmp_path / 'cell2').mkdir()
    pattern = NamePattern('{cell}/*')
    again(path, out, names=pattern)
    moved = path.rename(tmp_path / 'cell2/a.mcap')
    owners = {'a': [str(path)]}
    assert do_task(task(moved, out, names=pattern, owners=owners)).same_as == ''
    assert {row[:2] for row in asked(out)} == {(str(moved), 'cell2')}
    assert [each.name for each in (out / 'recordings').iterdir()] == ['a.mcap']
    assert again(moved, out, names=pattern).same_as == str(moved)


def test_a_copy_of_what_its_location_holds_no_more_is_measured(tmp_path):
    """Whichever of the two inputs is done first."""
    path, copy, out = recorded(tmp_path / 'a.mcap'), tmp_path / 'b.mcap', tmp_path / 'out'
    again(path, out)
    copy.write_bytes(path.read_bytes())
    new = recorded(tmp_path / 'new.mcap', seed=1).rename(path)
    os.utime(new, (1, 1))
    task_of_new = task(new, out, earlier=entries_at(out, new))
    again(copy, out)
    do_task(task_of_new)
    assert [row[:1] + row[-1:] for row in asked(out)] == [(str(each), 'ok') for each in (new, new, copy, copy)]


@pytest.mark.parametrize('step', ['filter_recording', 'write_rows', 'record'])
@pytest.mark.parametrize('first', ['a', 'b'])
def test_two_workers_at_a_rotation_do_not_remove_what_the_other_makes(tmp_path, monkeypatch, step, first):
    """One does all of its task where the other is about to filter, to write its rows, or to record."""
    path, rotated, out = recorded(tmp_path / 'a.mcap'), tmp_path / 'b.mcap', tmp_path / 'out'
    again(path, out)
    path.rename(rotated)
    recorded(path, seed=1)
    tasks = {each.stem: task(each, out, earlier=entries_at(out, each)) for each in (path, rotated)}
    in_between(monkeypatch, step, tasks.pop('b' if first == 'a' else 'a'))
    assert do_task(*tasks.values()).entry.failure is None
    assert all_is_there(out)
    assert {row[0] for row in asked(out)} == {str(path), str(rotated)}


@pytest.mark.parametrize('step', ['filter_recording', 'write_rows'])
def test_two_workers_at_copies_leave_the_results_of_one(tmp_path, monkeypatch, step):
    path, copy, out = recorded(tmp_path / 'a.mcap'), tmp_path / 'b.mcap', tmp_path / 'out'
    copy.write_bytes(path.read_bytes())
    again(path, out)
    in_between(monkeypatch, step, task(copy, out, digest='other'))
    do_task(task(path, out, digest='other'))
    assert all_is_there(out)
    assert len(asked(out)) == 2


def test_an_original_that_is_only_touched_is_still_there(tmp_path):
    path, copy, out = recorded(tmp_path / 'a.mcap'), tmp_path / 'b.mcap', tmp_path / 'out'
    again(path, out)
    copy.write_bytes(path.read_bytes())
    os.utime(path, (1, 1))
    assert again(copy, out).same_as == str(path)


def test_an_unexpected_error_is_told_as_well(tmp_path, monkeypatch):
    path = recorded(tmp_path / 'a.mcap')

    def broken(*_, **__):
        raise ZeroDivisionError('division by zero')

    monkeypatch.setattr('socialcircle_ros.archive.work.filter_recording', broken)
    assert do_task(task(path, tmp_path / 'out')).entry.failure == 'ZeroDivisionError: division by zero'


@pytest.mark.parametrize('blocked', ['measurements', 'inputs', 'recordings', 'reports'])
def test_results_that_cannot_be_written_are_a_failure_that_is_told(tmp_path, blocked):
    path, out = recorded(tmp_path / 'a.mcap', clouds=1), tmp_path / 'out'
    out.mkdir()
    (out / blocked).write_text('')
    assert str(out / blocked) in do_task(task(path, out, reports=True)).entry.failure


def test_a_failure_that_cannot_be_recorded_is_told(tmp_path, monkeypatch):
    (tmp_path / 'a.mcap').write_bytes(b'no recording')

    def broken(*_):
        raise ZeroDivisionError('division by zero')

    monkeypatch.setattr('socialcircle_ros.archive.work.write_rows', broken)
    failure = do_task(task(tmp_path / 'a.mcap', tmp_path / 'out')).entry.failure
    assert failure.endswith('It has no row: ZeroDivisionError: division by zero')
    assert 'a.mcap' in failure


def test_a_cell_with_a_name_too_long_for_a_folder_is_cut(tmp_path):
    cells = [f'A{"測" * 30}{number}' for number in range(2)]
    for cell in cells:
        path = recorded(tmp_path / cell / 'a.mcap', clouds=1, seed=int(cell[-1]))
        assert do_task(task(path, tmp_path / 'out', names=NamePattern('{cell}/*'))).entry.failure is None
    found = asked(tmp_path / 'out', 'select cell from measurements')
    assert len({cell for (cell,) in found}) == 2
    assert all(cell.startswith('A測測') for (cell,) in found)


def test_a_refused_cloud_is_a_row_between_the_others(tmp_path):
    path = recorded(tmp_path / 'a.mcap', message=cloud(1, 9))
    result = do_task(task(path, tmp_path / 'out'))
    assert (result.entry.clouds, sum(result.entry.refused.values())) == (0, 2)
    assert [row[-1] for row in asked(tmp_path / 'out')] == ['refused', 'refused']


def test_a_refused_cloud_has_the_time_of_its_stamp_where_that_can_be_read(tmp_path):
    """And not that of its recording, which is an hour later."""
    path, late = tmp_path / 'a.mcap', NOON + 3_600_000_000_000
    with RecordingWriter(path) as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        for message in (cloud(stamp=NOON), cloud(1, 9, stamp=NOON), b'no cloud'):
            writer.write('/points', message, late)
    do_task(task(path, tmp_path / 'out'))
    query = 'select number, status, epoch(time)::bigint, stamp, frame is null from measurements order by number'
    stamp = f'{NOON // 10**9}.000000000'
    assert asked(tmp_path / 'out', query) == [
        (0, 'ok', NOON // 10**9, stamp, False),
        (1, 'refused', NOON // 10**9, stamp, False),
        (2, 'refused', late // 10**9, None, True),
    ]


def test_a_report_is_written_on_request(tmp_path):
    pytest.importorskip('matplotlib')
    do_task(task(recorded(tmp_path / 'a.mcap', clouds=1), tmp_path / 'out', reports=True))
    page = (tmp_path / 'out/reports/a.mcap.html').read_text()
    assert 'id="measurement--cell1-points-0"' in page


def test_the_page_of_trends_links_to_where_the_report_has_the_cloud_of_a_file(tmp_path):
    for library in ('matplotlib', 'bokeh'):
        pytest.importorskip(library)
    from socialcircle_ros.archive.trend import read_series

    write_surface(tmp_path / 'lid 8.npz', MeasuredSurface(surface()[..., 2], (1.0, 1.0), 'um'))
    for path in (tmp_path / 'lid 8.npz', recorded(tmp_path / 'a.mcap', clouds=1)):
        do_task(task(path, tmp_path / 'out', reports=True))
    links = [
        link for series in read_series(tmp_path / 'out', tmp_path / 'out/trend.html') for link in series.links
    ]
    assert len(links) == 2
    for page, anchor in (unquote(link).split('#') for link in links):
        assert f'id="{anchor}"' in (tmp_path / 'out' / page).read_text()


def test_what_a_run_does_not_make_again_is_removed(tmp_path):
    pytest.importorskip('matplotlib')
    path, out = recorded(tmp_path / 'a.mcap', clouds=1), tmp_path / 'out'

    def made():
        return sorted(
            str(each.relative_to(out)) for name in ('recordings', 'reports') for each in out.glob(f'{name}/*')
        )

    do_task(task(path, out, reports=True))
    assert made() == ['recordings/a.mcap', 'reports/a.mcap.html']
    do_task(task(path, out, digest='other'))
    assert made() == ['recordings/a.mcap']
    do_task(task(path, out, digest='rows', recordings=False))
    assert made() == []
    do_task(task(path, out, reports=True, digest='again'))
    path.write_bytes(b'half a re')
    again(path, out)
    assert made() == []


def test_an_input_of_an_object_store_is_copied_for_a_while(tmp_path):
    fsspec = pytest.importorskip('fsspec')
    files = fsspec.filesystem('memory')
    files.pipe('/archive/a.mcap', (BAGS / 'padded.mcap').read_bytes())
    files.pipe('/archive/b.mcap', b'no recording')
    try:
        assert (
            'memory:///archive/b.mcap' in do_task(task('memory://archive/b.mcap', tmp_path / 'bad')).entry.failure
        )
        assert do_task(task('memory://archive/a.mcap', tmp_path / 'out')).entry.clouds == 2
    finally:
        files.rm('/archive', recursive=True)
    assert {row[0] for row in asked(tmp_path / 'out')} == {'memory:///archive/a.mcap'}


def test_memory_does_not_grow_with_the_recording(tmp_path):
    """A recording of 130 MB is filtered by a process that may take 70 MB more than it has."""
    rows, columns = 90, 100
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    fields = {f'f{number}': np.zeros((rows, columns)) for number in range(54)}
    xyz = np.dstack([x, y, np.random.default_rng(0).random((rows, columns), np.float32)])
    message = encode_point_cloud(Header.at(NOON, 'm'), xyz, fields)
    path = recorded(tmp_path / 'large.mcap', clouds=32, message=message)
    assert path.stat().st_size > 120e6
    small = recorded(tmp_path / 'small.mcap', clouds=1, message=message)
    do_task(task(small, tmp_path / 'out'))  # compiles, and starts the threads
    status = Path('/proc/self/status').read_text()
    now = int(status.partition('VmData:')[2].split()[0]) * 1024
    limits = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (now + 70_000_000, limits[1]))
    try:
        result = do_task(task(path, tmp_path / 'out'))
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, limits)
    assert (result.entry.clouds, result.entry.failure) == (32, None)
    with open_recording(tmp_path / 'out/recordings/large.mcap') as reader:
        assert reader.topics
