# SPDX-License-Identifier: Apache-2.0
"""The engine, with Dask in this process and with a process of its own."""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest
from clusters import cluster_in_this_process

from socialcircle_ros import engine
from socialcircle_ros.engine import Engine
from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.kernels import bands

pytest.importorskip('distributed')


@pytest.fixture(scope='module')
def scheduler():
    before = bands.limit
    with cluster_in_this_process() as address:
        yield address
    bands.limit = before


def divided(number):
    return 1 / number


def test_every_item_has_one_result_and_an_error_is_one(scheduler):
    with Engine(scheduler) as running:
        results = dict(running.run(divided, range(200)))
    assert len(results) == 200
    assert isinstance(results.pop(0), ZeroDivisionError)
    assert results == {number: 1 / number for number in range(1, 200)}


def test_items_may_depend_on_the_results_before_them(scheduler):
    found = [1]
    with Engine(scheduler) as running:
        items = (len(found) for _ in range(5))
        for item, result in running.run(divided, items, eager=False):
            assert item == len(found)  # there is one thread
            found.append(result)
    assert found == [1, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 5]


def test_results_are_asked_for_one_by_one_where_one_of_them_is_lost(scheduler, monkeypatch):
    def lost(futures):
        raise distributed.scheduler.KilledWorker(futures[0].key, None, [], 3)

    distributed = pytest.importorskip('distributed')
    with Engine(scheduler) as running:
        monkeypatch.setattr(running._client, 'gather', lost)
        assert dict(running.run(divided, [1, 2])) == {1: 1, 2: 1 / 2}


def test_a_worker_with_another_version_is_told():
    with pytest.raises(SocialCircleError, match='needs socialcircle_ros 0.0, as the client, and has version'):
        engine._call(divided, '0.0', 2)


def test_a_cluster_whose_workers_lack_the_package_is_refused_at_once(monkeypatch, scheduler):
    distributed = pytest.importorskip('distributed')
    answers = {'tcp://a:1': version('socialcircle_ros'), 'tcp://b:1': PackageNotFoundError('socialcircle_ros')}
    monkeypatch.setattr(distributed.Client, 'run', lambda *_, **__: answers)
    with pytest.raises(SocialCircleError, match='The worker tcp://b:1 needs socialcircle_ros .*, and has none'):
        Engine(scheduler)


PRELOADED = """
import sys
from pathlib import Path
from clusters import ends_once
from socialcircle_ros.engine import Engine

mark = Path(sys.argv[1])
with Engine(None, 1, ['tabnanny']) as running:
    assert list(running.run(ends_once, [mark])) == [(mark, True)]
assert 'tabnanny' not in sys.modules
"""


def test_a_process_that_ends_loses_nothing_and_modules_are_loaded_once_for_all(tmp_path):
    # In a process of its own: other tests may have begun this one's server of forks, with modules of theirs.
    done = subprocess.run(
        [sys.executable, '-c', PRELOADED, tmp_path / 'mark'],
        cwd=Path(__file__).parent, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_a_scheduler_that_does_not_answer_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr('socialcircle_ros.engine._CONNECT_S', 0.2)
    for address in ('tcp://127.0.0.1:9', str(tmp_path / 'none.json')):
        with pytest.raises(SocialCircleError, match='No Dask scheduler answers at'):
            Engine(address)


def test_without_dask_the_extra_is_told(monkeypatch):
    monkeypatch.setattr(engine.importlib.util, 'find_spec', lambda name: None)
    with pytest.raises(SocialCircleError, match='This needs Dask: pip install '):
        Engine()


def test_dask_leaves_nothing_in_the_current_folder_where_that_has_to_serve_for_temporary_files(tmp_path):
    program = f"""
import os, sys, tempfile
from pathlib import Path
from socialcircle_ros.engine import Engine
tempfile.tempdir = {str(tmp_path)!r}
if __name__ == '__main__':
    with Engine(workers=1) as running:
        print(dict(running.run(abs, [-2])))
        print(any(Path().iterdir()))
"""
    done = subprocess.run(
        [sys.executable, '-c', program], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=100
    )
    assert done.stdout.splitlines() == ['{-2: 2}', 'True']
    assert not list(tmp_path.iterdir())


def test_dask_chooses_its_folder_where_there_is_one_for_temporary_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with engine._own_folder() as folder:
        assert folder is None
