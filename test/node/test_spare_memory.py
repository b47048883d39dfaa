# SPDX-License-Identifier: Apache-2.0
"""What the node gives back of the memory that piled up."""

import platform
import subprocess
import sys

import pytest

from socialcircle_ros.node import spare_memory
from socialcircle_ros.node.spare_memory import LOOKS, MARGIN, PLANES_HELD, SpareMemory

CLOUD, PLANE = 20_000_000, 1_250_000

PILE = f"""
import ctypes, resource
from socialcircle_ros.kernels import memory
from socialcircle_ros.node.spare_memory import LOOKS, SpareMemory

library = memory._allocator()

def resident():
    return int(open('/proc/self/statm').read().split()[1]) * resource.getpagesize()

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def write(block):
    ctypes.memset(block, 1, {CLOUD})
    return block

memory.keep_freed_memory()
clouds = [write(library.malloc({CLOUD})) for _ in range(9)]
held = clouds[:3]
for cloud in clouds[3:]:
    library.free(cloud)
before = resident()
spare = SpareMemory()
for _ in range(LOOKS - 1):
    spare.look({CLOUD}, {PLANE})
print(before - resident() < {CLOUD})
spare.look({CLOUD}, {PLANE})
print(before - resident() > 3 * {CLOUD})
first = faults()
clouds = [write(library.malloc({CLOUD})) for _ in range(2)]
print(faults() - first < 500)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != 'glibc', reason='only glibc tells what is freed')
def test_what_stays_free_is_given_back_but_for_the_next_clouds():
    done = subprocess.run([sys.executable, '-c', PILE], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ['True'] * 3


@pytest.fixture
def given(monkeypatch):
    """What is given back: the sizes that are kept; `free` gives what is free at each look."""
    kept = []

    def looks(free):
        sizes = iter(free)
        monkeypatch.setattr(spare_memory, 'freed_bytes', lambda: next(sizes))
        monkeypatch.setattr(spare_memory, 'give_back_all_but', kept.append)
        return SpareMemory()

    looks.kept = kept
    return looks


def test_what_a_stream_uses_at_times_is_kept(given):
    spare = given([6 * CLOUD, 3 * CLOUD] * LOOKS)  # used by three clouds now and then
    for _ in range(LOOKS):
        spare.look(CLOUD, PLANE)
    assert given.kept == []
    spare = given([7 * CLOUD, 4 * CLOUD] * LOOKS)
    for _ in range(LOOKS):
        spare.look(CLOUD, PLANE)
    assert given.kept == [[PLANE] * PLANES_HELD + [CLOUD] * MARGIN]  # the last look sees four free ones


def test_what_is_given_back_already_is_not_given_back_again_until_it_was_used(given):
    looks = [9 * CLOUD] * 2 * LOOKS + [2 * CLOUD] * LOOKS + [9 * CLOUD] * LOOKS  # free even if it is given back
    spare = given(looks)
    for number in range(len(looks)):
        spare.look(CLOUD, PLANE)
        assert len(given.kept) == (number >= LOOKS - 1) + (number == len(looks) - 1)


def test_after_a_tiny_cloud_nothing_is_given_back(given):
    spare = given([60_000_000] * (LOOKS - 1) + [120_000_000])
    for _ in range(LOOKS):
        spare.look(200, 12)
    assert given.kept == []


def test_little_is_not_given_back_nor_what_others_will_use(given):
    spare = given([spare_memory.WORTH] * LOOKS)
    for _ in range(LOOKS):
        spare.look(100_000, 6_000)
    spare = given([9 * CLOUD] * 2 * LOOKS)
    for _ in range(2 * LOOKS - 1):
        spare.look(CLOUD, PLANE)
        spare.use()
    assert given.kept == []
