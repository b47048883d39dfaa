# SPDX-License-Identifier: Apache-2.0
"""The cores that the process may use."""

import os

import pytest

from socialcircle_ros.kernels.machine import hardware, usable_cores

AFFINITY = len(os.sched_getaffinity(0))


@pytest.fixture(params=['version 1', 'version 2'])
def quota(request, tmp_path):
    """Writes the files of a control group."""

    def write(limit, period=100_000):
        if request.param == 'version 2':
            (tmp_path / 'cpu.max').write_text(f'{"max" if limit is None else limit} {period}\n')
        else:
            (tmp_path / 'cpu').mkdir()
            (tmp_path / 'cpu' / 'cpu.cfs_quota_us').write_text(f'{-1 if limit is None else limit}\n')
            (tmp_path / 'cpu' / 'cpu.cfs_period_us').write_text(f'{period}\n')
        return tmp_path

    return write


@pytest.mark.parametrize(
    ('limit', 'cores'),
    [(None, AFFINITY), (100_000, 1), (1_000, 1), (150_000, min(2, AFFINITY)), (10**9, AFFINITY)],
)
def test_the_quota_of_the_control_group_limits_the_cores(quota, limit, cores):
    assert usable_cores(quota(limit)) == cores


def test_without_a_control_group_the_affinity_counts(tmp_path):
    assert usable_cores(tmp_path) == AFFINITY


def test_a_file_that_holds_no_numbers_sets_no_limit(tmp_path):
    (tmp_path / 'cpu.max').write_text('much')
    assert usable_cores(tmp_path) == AFFINITY


def test_the_hardware_names_the_cores():
    assert f'{usable_cores()} cores' in hardware()
