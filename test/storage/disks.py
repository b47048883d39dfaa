# SPDX-License-Identifier: Apache-2.0
"""Small disks for tests."""

import contextlib
import os
import subprocess

import pytest


@contextlib.contextmanager
def small_disk(folder, size, *, real=False):
    """A disk of `size` bytes at `folder`, in memory or `real`; the test is skipped where none can be mounted."""
    folder.mkdir()
    commands = [['mount', '-t', 'tmpfs', '-o', f'size={size}', 'small_disk', str(folder)]]
    if real:
        image = folder.with_suffix('.ext4')
        image.write_bytes(b'')
        os.truncate(image, size)
        commands = [['mkfs.ext4', '-q', str(image)], ['mount', '-o', 'loop', str(image), str(folder)]]
    for command in commands:
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except FileNotFoundError as missing:
            pytest.skip(f'no small disk can be made: {missing}')
        if done.returncode:
            pytest.skip(f'no small disk can be mounted: {done.stderr.strip()}')
    try:
        yield folder
    finally:
        subprocess.run(['umount', '--lazy', str(folder)], check=True)


def fill(folder, left=0):
    """Fill a disk until `left` bytes are free."""
    with (folder / 'ballast').open('wb') as file:
        with contextlib.suppress(OSError):
            while True:
                os.write(file.fileno(), bytes(4096))
        file.truncate(max(0, os.fstat(file.fileno()).st_size - left))
