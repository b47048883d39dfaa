# SPDX-License-Identifier: Apache-2.0
"""The journey of a night shift: a hundred parts, what changed among them, which failed, and a report of one.

Each step is a command, as a person gives it in the morning; they run in this process, which saves its imports.
"""

import re

import numpy as np
import pytest
from browser import browser
from clusters import cluster_in_this_process
from examples import surface

from socialcircle_ros.commands.main import main
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.messages.header import Header
from socialcircle_ros.recording import RecordingWriter, ros_topic

for library in ('distributed', 'fsspec', 'pyarrow', 'duckdb', 'bokeh', 'matplotlib'):
    pytest.importorskip(library)

EVENING = 1_790_000_000_000_000_000
PARTS, BASELINE = 50, 20  # clouds of each of two cells, and those that control limits are computed from
WORN_FROM = 30  # in cell2
DIRTY, CUT = 35, 41  # in cell1, after the baseline
LIMIT = ('-p', 'limits.outlier_share_max:=0.05')


@pytest.fixture(scope='module')
def morning(tmp_path_factory):
    """The recordings of the night: cell2 wears, one part of cell1 is dirty, and one file is cut off."""
    folder = tmp_path_factory.mktemp('morning')
    for cell, seed in (('cell1', 1000), ('cell2', 2000)):
        for part in range(PARTS):
            points = surface(seed=seed + part)
            points[..., 2] *= 1 + 0.02 * max(0, part - WORN_FROM) if cell == 'cell2' else 1.0
            if (cell, part) == ('cell1', DIRTY):
                rng = np.random.default_rng(part)
                points[..., 2][rng.random(points.shape[:2]) < 0.1] += 40
            path = folder / f'night/{cell}/lid_{part:02d}.mcap'
            path.parent.mkdir(parents=True, exist_ok=True)
            time = EVENING + part * 60_000_000_000
            with RecordingWriter(path) as writer:
                writer.add_topic(ros_topic('/points', point_cloud.TYPE))
                writer.write(
                    '/points', point_cloud.encode_point_cloud(Header.at(time, 'microscope'), points), time
                )
    cut = folder / f'night/cell1/lid_{CUT}.mcap'
    cut.write_bytes(cut.read_bytes()[:5000])
    return folder


def test_what_changed_and_which_failed_is_found_and_one_of_them_is_looked_at(morning, monkeypatch, capfd):
    monkeypatch.chdir(morning)

    def socialcircle(*arguments):
        code = main(list(arguments))
        return code, *capfd.readouterr()

    with cluster_in_this_process() as scheduler:
        names = ('--names', '{cell}/{part}_*.mcap')
        code, out, err = socialcircle(
            'batch', 'night', '-o', 'out', '--no-recordings', *names, *LIMIT, '--scheduler', scheduler
        )
    assert code == 1
    assert out.startswith('100 inputs: 99 filtered with 99 clouds; 1 failed, 0 damaged.')
    assert f'lid_{CUT}.mcap' in err
    (told,) = [line for line in err.splitlines() if 'failed the limits' in line]
    code, out, err = socialcircle('trend', 'out', '--baseline', str(BASELINE))
    assert code == 0, err
    drifting = re.findall(r'^(.*) drifts: (.*)\.$', out, re.MULTILINE)
    assert [(cell, 'Sq' in measures) for cell, measures in drifting] == [('cell2, lid', True)]
    query = re.search(r'socialcircle measurements (out) "(.*)"', told)
    code, out, err = socialcircle('measurements', *query.groups())
    assert code == 0, err
    failed = re.findall(r'\S+\.mcap', out)
    assert [name.rpartition('/')[2] for name in failed] == [f'lid_{DIRTY}.mcap']
    code, out, err = socialcircle('report', failed[0], '-o', 'dirty.html', *LIMIT)
    assert code == 3
    assert 'more than 5 %' in err
    with browser() as chromium:
        page = chromium.new_page()
        page.goto((morning / 'trend.html').as_uri())
        assert page.get_by_role('row', name=re.compile('cell2 lid .*Sq')).is_visible()
        page.goto((morning / 'dirty.html').as_uri())
        assert page.locator('.banner.failed').first.is_visible()
