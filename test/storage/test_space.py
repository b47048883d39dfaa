# SPDX-License-Identifier: Apache-2.0
"""The space on a disk."""

import pytest
from storage.disks import fill, small_disk

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.storage import Reserve, free_bytes, is_full, write_file


@pytest.fixture
def disk(tmp_path):
    with small_disk(tmp_path / 'disk', 1 << 20) as folder:
        yield folder


def test_the_free_space_is_what_can_be_written(disk):
    assert free_bytes(disk) == 1 << 20
    (disk / 'a').write_bytes(bytes(300_000))
    assert free_bytes(disk) == (1 << 20) - 303_104
    fill(disk)
    assert free_bytes(disk) == 0


def test_a_reserve_is_held_until_it_is_given_back(disk):
    reserve = Reserve(disk)
    reserve.hold(500_000)
    reserve.hold(1000)
    assert reserve.size == 500_000
    assert free_bytes(disk) < 600_000
    assert list(disk.iterdir()) == []
    fill(disk)
    with pytest.raises(OSError, match='No space left') as caught:
        reserve.hold(600_000)
    assert is_full(caught.value)
    assert reserve.give_back()
    assert not reserve.give_back()
    assert reserve.used
    (disk / 'a').write_bytes(bytes(500_000))


def test_a_reserve_that_cannot_grow_leaves_the_rest_of_the_disk_free(disk):
    reserve = Reserve(disk)
    reserve.hold(100_000)
    free = free_bytes(disk)
    with pytest.raises(OSError, match='No space left'):
        reserve.hold(2 << 20)
    assert free_bytes(disk) == free
    reserve.close()
    assert not reserve.used


def test_a_file_that_does_not_fit_leaves_what_was_there(disk):
    (disk / 'a').write_text('old')
    fill(disk, 8192)
    with pytest.raises(SocialCircleError, match='cannot be written: No space left on device'):
        write_file(disk / 'a', bytes(20_000))
    assert (disk / 'a').read_text() == 'old'
    assert sorted(path.name for path in disk.iterdir()) == ['a', 'ballast']
