# SPDX-License-Identifier: Apache-2.0
"""When a surface was measured, where its file states it."""

import zipfile
from datetime import datetime, timezone

import numpy as np
import pytest

from socialcircle_ros.formats import MeasuredSurface, read_file, stated_time, write_surface
from socialcircle_ros.recording import import_cloud

NOON = 1_790_000_000_000_000_000
"""2026-09-21 14:13:20 UTC, in ns."""


def surface(metadata=None):
    heights = np.random.default_rng(0).normal(0, 1e-7, (6, 7)).astype(np.float32)
    return MeasuredSurface(heights, (1e-6, 1e-6), 'm', {}, metadata or {})


@pytest.mark.parametrize(
    'date',
    [
        '2026-09-21T14:13:20',
        ' 2026-09-21 14:13:20.999 ',
        '2026-09-21T14:13:20Z',
        '2026-09-21T16:13:20.5+02:00',
        '2026-09-21T09:43:20-0430',
    ],
)
def test_a_date_is_a_time_and_one_without_a_zone_is_in_utc(date):
    assert stated_time({'date': date}) == NOON


@pytest.mark.parametrize('date', ['', 'yesterday', '2026-09-21', '21.09.2026 14:13:20', '2026-13-21T14:13:20'])
def test_what_is_no_date_is_no_time(date):
    assert stated_time({'date': date}) is None


def test_the_stamp_of_an_exported_cloud_comes_before_a_date():
    assert stated_time({'stamp': '1790000000.000000007', 'date': '2001-01-01T00:00:00'}) == NOON + 7
    assert stated_time({'stamp': 'now'}) is None
    assert stated_time({}) is None


@pytest.mark.parametrize('suffix', ['.npz', '.ply', '.pcd', '.csv', '.xyz', '.x3p', '.sdf', '.tiff'])
def test_an_exported_file_states_the_time_of_its_cloud(tmp_path, suffix):
    for stamp, time in (('1790000000.000000000', NOON), ('5.000000000', None)):
        path = tmp_path / f'a{suffix}'
        write_surface(path, surface({'stamp': stamp}), overwrite=True)
        assert import_cloud(path).measured_ns == time


def test_the_date_in_an_x3p_file_is_the_time_and_1970_is_none(tmp_path):
    write_surface(tmp_path / 'a.x3p', surface())
    assert import_cloud(tmp_path / 'a.x3p').measured_ns is None
    for date, time in ((b'2026-09-21T14:13:20Z', NOON), (b'1970-01-01T01:00:00', None)):
        record = b'<Record2><Date>' + date + b'</Date></Record2><Record3>'
        with zipfile.ZipFile(tmp_path / 'a.x3p') as old, zipfile.ZipFile(tmp_path / 'b.x3p', 'w') as new:
            for name in old.namelist():
                new.writestr(name, old.read(name).replace(b'<Record3>', record))
        assert import_cloud(tmp_path / 'b.x3p').measured_ns == time


def test_the_date_in_an_sdf_file_is_the_time(tmp_path):
    write_surface(tmp_path / 'a.sdf', surface())
    assert import_cloud(tmp_path / 'a.sdf').measured_ns is None
    text = (tmp_path / 'a.sdf').read_text()
    (tmp_path / 'b.sdf').write_text(text.replace('CreateDate  = 000000000000', 'CreateDate  = 210920261413'))
    time = datetime(2026, 9, 21, 14, 13, tzinfo=timezone.utc)
    assert import_cloud(tmp_path / 'b.sdf').measured_ns == time.timestamp() * 1e9
    assert read_file(tmp_path / 'b.sdf').metadata == {'date': '2026-09-21T14:13:00'}
