# SPDX-License-Identifier: Apache-2.0
"""What a process for large clouds asks of the C library and of the system."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != 'linux', reason='only Linux shows the memory of a process')

SMAPS = """
def smaps(wanted):
    found, total = False, {}
    for line in open('/proc/self/smaps'):
        word, *values = line.split()
        if not word.endswith(':'):
            found = wanted(values[0], values[-1])
        elif found and values[-1] == 'kB':
            total[word] = total.get(word, 0) + int(values[0])
    return total

def heap():
    return smaps(lambda access, path: path == '[heap]')
"""

HEAP = f"""
import resource
{SMAPS}
from socialcircle_ros.kernels import memory

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

def write(size):
    before = faults()
    block = bytearray(size)
    return faults() - before

memory.keep_freed_memory()
memory.reserve_memory(60_000_000)
reserved = heap()
print([reserved['Rss:'] > 55_000, write(20_000_000) < 500])
memory.give_back_freed_memory()
print([heap()['Rss:'] < 20_000, write(20_000_000) > 4_000])
"""

ROOM = f"""
import ctypes
{SMAPS}
from socialcircle_ros.kernels import memory

LARGE, SMALL = 20_000_000, 1_000_000

def end():
    return max(int(line.split()[0].partition('-')[2], 16) for line in open('/proc/self/maps') if '[heap]' in line)

library = ctypes.CDLL(None)
library.malloc.restype, library.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
library.free.argtypes = [ctypes.c_void_p]
memory.keep_freed_memory()
memory.reserve_memory(3 * (LARGE + 100), ROOM)
clouds = [library.malloc(LARGE) for _ in range(3)]
library.free(clouds.pop(1))
planes = [library.malloc(SMALL) for _ in range(4)]
before = end()
clouds.append(library.malloc(LARGE))
print(end() - before > LARGE / 2)
"""

NO_MEMORY = """
import resource
from socialcircle_ros.kernels import memory

memory.keep_freed_memory()
size = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (size + 1_000_000, resource.RLIM_INFINITY))
memory.reserve_memory(100_000_000, 7_000_000)
print('goes on')
"""

CODE = f"""
{SMAPS}
from socialcircle_ros.kernels import compiled, memory

def code():
    return smaps(lambda access, path: 'w' not in access and 'libllvmlite' in path)['Rss:']

before = code()
memory.unmap_code('libllvmlite')
after = code()
compiled._nothing()
print([after < before / 4, code() > after])
"""


def printed(program):
    """What a process of its own prints."""
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=True)
    return done.stdout.split('\n')[:-1]


def test_memory_that_is_reserved_is_at_hand_until_it_is_given_back():
    assert printed(HEAP) == ['[True, True]', '[True, True]']


def test_small_blocks_lie_in_a_room_of_their_own_and_do_not_break_up_that_of_a_cloud():
    assert printed('ROOM = 0' + ROOM) == ['True']  # the heap grows by a cloud
    assert printed('ROOM = 5_000_000' + ROOM) == ['False']


def test_a_system_without_so_much_memory_reserves_none():
    assert printed(NO_MEMORY) == ['goes on']


def test_the_code_of_a_library_is_unmapped_until_it_is_used():
    assert printed(CODE) == ['[True, True]']
