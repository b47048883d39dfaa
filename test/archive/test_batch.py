# SPDX-License-Identifier: Apache-2.0
"""`run_batch` on real Dask: in this process, and with a scheduler and two workers, one of which is killed."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from archive.archives import BAGS, object_store, recorded
from clusters import cluster_in_this_process, cluster_of_processes
from examples import surface
from settings.test_lessons import PLAIN

from socialcircle_ros import open_measurements, run_batch
from socialcircle_ros.archive.ledger import Ledger, LedgerEntry
from socialcircle_ros.archive.trend_page import write_trend
from socialcircle_ros.errors import SettingError, SocialCircleError, UnitWarning
from socialcircle_ros.recording import open_recording
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.settings import PipelineSettings

for library in ('distributed', 'fsspec', 'pyarrow', 'duckdb'):
    pytest.importorskip(library)

EACH_ONCE = """
select count(*), count(distinct (content, topic, number)), count(distinct recording) from measurements
where status = 'ok' and outliers between 26 and 27
"""


@pytest.fixture(scope='module')
def scheduler():
    with cluster_in_this_process() as address:
        yield address


def rows(output, query='select recording, number, status from measurements order by all'):
    return open_measurements(output).sql(query).fetchall()


@pytest.mark.long
def test_an_archive_is_done_once_and_then_only_what_is_new(tmp_path, scheduler):
    for number in range(3):
        recorded(tmp_path / f'nights/{number}.mcap', seed=number)
    seen, dashboards = [], []

    def run(**options):
        seen.clear()
        return run_batch(
            [tmp_path / 'nights'],
            tmp_path / 'out',
            scheduler=scheduler,
            progress=lambda done, total: seen.append((done, total)),
            started=dashboards.append,
            **options,
        )

    first = run()
    assert (first.inputs, first.done, first.clouds, first.skipped, first.failed) == (3, 3, 6, 0, {})
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert len(dashboards) == 1
    recorded(tmp_path / 'nights/3.mcap', seed=3)
    (tmp_path / 'nights/bad.mcap').write_bytes(b'no recording')
    (tmp_path / 'nights/copy.mcap').write_bytes((tmp_path / 'nights/0.mcap').read_bytes())
    left = tmp_path / 'out/recordings/0.mcap.12ab.partial'
    left.write_bytes(b'of a worker that was killed after another one had done its input')
    second = run()
    assert not left.exists()
    assert (second.done, second.skipped) == (1, 3)
    assert second.same == {str(tmp_path / 'nights/copy.mcap'): str(tmp_path / 'nights/0.mcap')}
    assert list(second.failed) == [str(tmp_path / 'nights/bad.mcap')]
    assert rows(tmp_path / 'out', EACH_ONCE) == [(8, 8, 4)]
    third = run(compression='lz4')
    assert (third.done, third.skipped) == (4, 0)
    assert rows(tmp_path / 'out', EACH_ONCE) == [(8, 8, 4)]


@pytest.mark.parametrize('output', ['out', '.'])
def test_results_among_the_inputs_are_no_inputs(tmp_path, scheduler, output):
    nights = tmp_path / 'nights'
    for number in range(2):
        recorded(nights / f'{number}.mcap', seed=number, clouds=1)
    runs = [run_batch([nights], nights / output, scheduler=scheduler) for _ in range(2)]
    assert [(each.inputs, each.done, each.skipped, each.left_out) for each in runs] == [(2, 2, 0, 0), (2, 0, 2, 2)]
    assert sorted(path.name for path in (nights / output / 'recordings').iterdir()) == ['0.mcap', '1.mcap']
    assert rows(nights / output) == [(str(nights / f'{number}.mcap'), 0, 'ok') for number in range(2)]


def test_a_damaged_recording_is_told_by_every_run(tmp_path, scheduler):
    content = recorded(tmp_path / 'whole.mcap', clouds=3).read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(content[: len(content) // 2])
    for _ in range(2):
        result = run_batch([tmp_path / 'cut.mcap'], tmp_path / 'out', scheduler=scheduler)
        assert 'cut.mcap is damaged' in result.damaged[str(tmp_path / 'cut.mcap')]


def test_a_recording_that_grows_is_measured_once(tmp_path, scheduler):
    path, out = tmp_path / 'nights/a.mcap', tmp_path / 'out'
    content = recorded(tmp_path / 'whole.mcap', clouds=3).read_bytes()
    path.parent.mkdir()
    for share in (0.5, 0.8, 1):
        path.write_bytes(content[: int(len(content) * share)])
        os.utime(path, (share, share))
        result = run_batch([path.parent], out, scheduler=scheduler)
    assert (result.done, result.damaged) == (1, {})
    assert rows(out) == [(str(path), number, 'ok') for number in range(3)]
    assert run_batch([path.parent], out, scheduler=scheduler).skipped == 1


def test_a_run_forgets_what_a_run_of_an_earlier_version_left_of_another_content(tmp_path, scheduler):
    path, out = recorded(tmp_path / 'nights/a.mcap'), tmp_path / 'out'
    run_batch([path.parent], out, scheduler=scheduler)
    ledger = Ledger(out)
    ledger.record('half', LedgerEntry(str(path), 1, '1', 'd', damage='a.mcap is damaged.'))
    result = run_batch([path.parent], out, scheduler=scheduler)
    assert (result.skipped, result.damaged) == (1, {})
    assert [entry.damage for entry in ledger.entries()] == [None]


def test_results_of_one_name_do_not_replace_those_of_another_run(tmp_path, scheduler):
    out = tmp_path / 'out'
    for number, name in enumerate(['cell1/night.mcap', 'cell2/night.mcap', 'both/night.mcap']):
        recorded(tmp_path / name, seed=number, clouds=1)
        run_batch([(tmp_path / name).parent], out, scheduler=scheduler)
    kept = (out / 'recordings/night.mcap').read_bytes()
    assert run_batch([tmp_path / 'cell1'], out, scheduler=scheduler).skipped == 1
    assert (out / 'recordings/night.mcap').read_bytes() == kept
    assert len(list((out / 'recordings').iterdir())) == 3


def test_an_archive_is_done_again_with_a_lesson_that_was_taught_again(tmp_path, scheduler):
    path, lesson = recorded(tmp_path / 'a.mcap', clouds=1), tmp_path / 'lid.json'
    done = []
    for threshold in (0.5, 0.5, 0.6):
        lesson.write_text(replace(PLAIN, threshold=threshold).to_text())
        settings = PipelineSettings.from_ros({'circle.lesson': str(lesson)})
        done.append(run_batch([path], tmp_path / 'out', settings, scheduler=scheduler).done)
    assert done == [1, 0, 1]


def test_a_unit_that_an_input_does_not_state_is_told(tmp_path, scheduler, recwarn):
    for name in 'ab':
        np.savez(tmp_path / f'{name}.npz', z=surface(seed=ord(name))[..., 2], dx=1.0, dy=2.0)
    result = run_batch([tmp_path / 'a.npz', tmp_path / 'b.npz'], tmp_path / 'out', scheduler=scheduler)
    assert sorted(result.units) == [
        f'{tmp_path}/{name}.npz does not state its unit: taken as µm; import --unit names it.' for name in 'ab'
    ]
    assert not [warning for warning in recwarn if issubclass(warning.category, UnitWarning)]


def test_a_url_is_done_and_not_copied_again(tmp_path, scheduler):
    import fsspec

    files = fsspec.filesystem('memory')
    files.pipe('/plant/a.mcap', recorded(tmp_path / 'a.mcap').read_bytes())
    try:
        first = run_batch(['memory://plant'], tmp_path / 'out', scheduler=scheduler)
        second = run_batch(['memory://plant'], tmp_path / 'out', scheduler=scheduler)
    finally:
        files.rm('/plant', recursive=True)
    assert (first.done, first.clouds) == (1, 2)
    assert (second.done, second.skipped, second.same) == (0, 1, {})
    assert len(rows(tmp_path / 'out')) == 2


def test_an_object_store_takes_the_results_and_a_rerun_does_what_is_new(tmp_path, scheduler, monkeypatch):
    pytest.importorskip('moto.server')
    pytest.importorskip('s3fs')
    with object_store(monkeypatch) as files:

        def run(**options):
            return run_batch(['s3://plant/in'], 's3://plant/out', scheduler=scheduler, **options)

        for number in range(2):
            files.put(str(recorded(tmp_path / f'{number}.mcap', seed=number)), f'plant/in/{number}.mcap')
        files.pipe('plant/in/bad.mcap', b'no recording')
        first = run()
        assert (first.done, first.clouds, list(first.failed)) == (2, 4, ['s3://plant/in/bad.mcap'])
        files.put(str(recorded(tmp_path / 'bad.mcap', seed=2)), 'plant/in/bad.mcap')
        second = run()
        assert (second.done, second.skipped, second.failed) == (1, 2, {})
        assert rows('s3://plant/out', EACH_ONCE) == [(6, 6, 3)]
        assert rows('s3://plant/out', 'select count(*) from measurements') == [(6,)]  # the failure is gone
        third = run(compression='lz4')
        assert (third.done, third.skipped) == (3, 0)
        assert rows('s3://plant/out', EACH_ONCE) == [(6, 6, 3)]
        kept = [name for name in files.find('plant/out') if '/measurements/' not in name]
        assert sorted({name.rpartition('/')[0] for name in kept}) == ['plant/out/inputs', 'plant/out/recordings']
        files.get('plant/out/recordings/0.mcap', str(tmp_path / 'cleaned.mcap'))
        filter_recording(tmp_path / '0.mcap', tmp_path / 'filtered.mcap', PipelineSettings())
        assert contents(tmp_path / 'cleaned.mcap') == contents(tmp_path / 'filtered.mcap')
        assert [series.title for series in write_trend('s3://plant/out', tmp_path / 'trend.html')] == ['cell1']
        run(recordings=False)
        assert rows('s3://plant/out', EACH_ONCE) == [(6, 6, 3)]
        files.invalidate_cache()
        assert not files.exists('plant/out/recordings')
        with pytest.raises(SocialCircleError, match='s3://plant/none has no measurements'):
            open_measurements('s3://plant/none')
        with pytest.raises(
            SocialCircleError, match='s3://none/out/inputs cannot be read: .* bucket does not exist'
        ):
            run_batch(['s3://plant/in/0.mcap'], 's3://none/out', scheduler=scheduler)


def contents(path):
    with open_recording(path) as reader:
        return [(message.topic, message.log_time, bytes(message.data)) for message in reader.messages()]


def test_the_client_loads_no_kernels_while_the_workers_load_them():
    program = 'import sys, socialcircle_ros.archive\nsys.exit(str({"numba", "numpy"} & set(sys.modules)))'
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == 'set()'


def test_the_process_that_workers_are_forked_from_is_left_without_a_thread():
    program = (
        'import threading; from socialcircle_ros.archive import preload;'
        ' preload._load_what_a_task_needs(); print(threading.active_count())'
    )
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=True)
    assert done.stdout == '1\n'


class TestCluster:
    """A scheduler and two workers, as they are started on a cluster."""

    @pytest.fixture
    def cluster(self, tmp_path):
        with cluster_of_processes(tmp_path) as cluster:
            yield cluster

    def test_ctrl_c_and_a_killed_worker_lose_nothing_and_do_nothing_twice(self, tmp_path, cluster):
        file, workers = cluster
        for number in range(24):
            recorded(tmp_path / f'nights/{number}.mcap', seed=number, clouds=6)
        command = ['batch', 'nights', '-o', 'out', '--scheduler', str(file)]
        client = subprocess.Popen(
            [sys.executable, '-m', 'socialcircle_ros.commands.main', *command],
            cwd=tmp_path,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, 'COLUMNS': '100'},
        )
        while client.poll() is None and not self.entries(tmp_path):
            time.sleep(0.05)
        client.send_signal(signal.SIGINT)
        told = client.communicate(timeout=300)[1]
        assert client.returncode == 130, told
        assert 'Stopped.' in told

        seen = []

        def kill_one(done, total):
            seen.append(done)
            if len(seen) == 2 and done < total:  # one more is done, and both workers have work
                workers[0].kill()

        result = run_batch([tmp_path / 'nights'], tmp_path / 'out', scheduler=str(file), progress=kill_one)
        assert workers[0].wait(300) == -signal.SIGKILL
        assert result.failed == {}
        assert result.done + result.skipped == 24
        assert rows(tmp_path / 'out', EACH_ONCE) == [(144, 144, 24)]
        names = sorted(str(path.relative_to(tmp_path / 'out')) for path in (tmp_path / 'out/recordings').iterdir())
        assert names == sorted(f'recordings/{number}.mcap' for number in range(24))
        assert len(self.entries(tmp_path)) == 24

    def entries(self, folder):
        return [json.loads(path.read_text())['location'] for path in (folder / 'out/inputs').glob('*.json')]


def test_another_compression_is_refused_before_the_work(tmp_path):
    with pytest.raises(SettingError, match="compression cannot be 'gzip'"):
        run_batch(BAGS / 'parts.mcap', tmp_path / 'out', compression='gzip')
    assert not list(tmp_path.iterdir())
