# SPDX-License-Identifier: Apache-2.0
"""The whole attack for as long as wanted: `make soak`, or `python -m attack.soak --minutes 60` in `test/`.

Rounds of every attack follow each other until the time is over. The seed of a round is printed when something does
not hold, so that the round can be repeated.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random

import conftest  # noqa: F401 - sets the DDS domain before rclpy starts
import pytest
from attack.generators import hostile_cloud
from attack.node import attack_lifecycle, attack_messages, attack_parameters, check_node
from attack.offline import attack_clouds, attack_recordings, attack_settings, attack_stacks
from attack.tally import Tally
from examples import cloud
from live import Cell
from storage.disks import fill, small_disk

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.recording import RecordingWriter, open_recording, ros_topic
from socialcircle_ros.recording.offline import filter_recording
from socialcircle_ros.settings import PipelineSettings
from socialcircle_ros.studies.bench.network import deliver, setups

LOSS = 0.01
HEADER = '| attack | tried | survived | wrong | lost |'


def attack_restarts(random: Random, count: int, folder: Path) -> Tally:
    """Nodes that are killed or ended while a hostile cloud arrives; each next one must work."""
    tally = Tally('restarts of the node')
    for _ in range(count):
        cell = Cell(folder)
        tally.tried += 1
        tally.survived += check_node(cell, tally, 10**9)
        cell.publish(hostile_cloud(random))
        if random.random() < 0.5:
            cell.kill()
            cell.close()
        elif cell.close() != 0 or 'Traceback' in cell.node_process.log.read_text():
            tally.wrong += 1
            tally.tell(f'a node did not end cleanly: {cell.node_process.log.read_text()[-300:]}')
    return tally


def attack_disks(random: Random, count: int, folder: Path) -> Tally:
    """Disks that are full: `filter` leaves nothing, and `record` keeps what was written."""
    tally = Tally('full disks')
    source = folder / 'source.mcap'
    clouds = [cloud(40, 50, seed=seed) for seed in range(20)]
    with RecordingWriter(source) as writer:
        writer.add_topic(ros_topic('/cell/points', point_cloud.TYPE))
        for number, message in enumerate(clouds):
            writer.write('/cell/points', message, number, number, number)
    try:
        for number in range(count):
            with small_disk(folder / f'disk{number}', 1 << 20) as disk:
                fill(disk, random.randrange(0, 600_000))
                tally.tried += 2
                tally.survived += filter_to_full_disk(tally, source, disk)
                tally.survived += record_to_full_disk(tally, clouds, disk)
    except pytest.skip.Exception as reason:
        tally.skipped = str(reason)
    return tally


def filter_to_full_disk(tally: Tally, source: Path, disk: Path) -> bool:
    try:
        filter_recording(source, disk / 'cleaned.mcap', PipelineSettings())
    except SocialCircleError:
        left = {path.name for path in disk.iterdir()} - {'ballast'}
        if left:
            tally.wrong += 1
            tally.tell(f'filter left {left} on a full disk')
        return True
    except Exception as error:  # noqa: BLE001 - this is what is looked for
        tally.tell(f'filter on a full disk: {error!r}')
        return False
    (disk / 'cleaned.mcap').unlink()
    return True


def record_to_full_disk(tally: Tally, clouds: list[bytes], disk: Path) -> bool:
    written = []
    try:
        with RecordingWriter(disk / 'night.mcap', keep=True) as writer:
            writer.add_topic(ros_topic('/cell/points', point_cloud.TYPE))
            for number, message in enumerate(clouds):
                writer.write('/cell/points', message, number, number, number)
                written.append(message)
    except SocialCircleError:
        pass
    except Exception as error:  # noqa: BLE001 - this is what is looked for
        tally.tell(f'record on a full disk: {error!r}')
        return False
    if not (disk / 'night.mcap').exists():
        tally.lost += len(written)
        return True
    with open_recording(disk / 'night.mcap') as reader:
        kept = [bytes(message.data) for message in reader.messages()]
    tally.lost += max(0, len(written) - len(kept))
    if kept != clouds[: len(kept)] or reader.damage is not None:
        tally.wrong += 1
        tally.tell(f'the recording of a full disk differs from what was written: {reader.damage}')
    return True


def attack_network(count: int) -> Tally:
    """Clouds of 20 MB between two hosts that lose one packet in a hundred, with the shipped profile."""
    tally = Tally(f'clouds of 20 MB, {LOSS:.0%} of packets lost')
    setup = next(each for each in setups() if each.name == 'fastdds_network.xml')
    try:
        found = deliver(setup, LOSS, count)
    except SocialCircleError as reason:
        tally.skipped = str(reason)
        return tally
    tally.tried, tally.survived, tally.lost = count, found.published, count - found.arrived
    return tally


def one_round(random: Random, folder: Path) -> Iterator[Tally]:
    """Every attack once, in small."""
    yield attack_clouds(random, 400)
    yield attack_stacks(random, 400)
    yield attack_settings(random, 300)
    yield attack_recordings(random, 100, folder)
    cell = Cell(folder)
    try:
        yield attack_messages(random, 30, cell)
        yield attack_parameters(random, 100, cell)
        yield attack_lifecycle(random, 40, cell)
    finally:
        cell.close()
    yield attack_restarts(random, 2, folder)
    yield attack_disks(random, 3, folder)
    yield attack_network(5)


def table(tallies: list[Tally]) -> str:
    """The counts as a table in Markdown."""
    rows = [HEADER, '| --- | --- | --- | --- | --- |']
    for each in tallies:
        counts = (each.tried, each.survived, each.wrong, each.lost)
        rows.append(f'| {each.kind} | {" | ".join(f"{count:,}" for count in counts)} |')
    rows += [f'{each.kind}: not possible here: {each.skipped}' for each in tallies if each.skipped]
    return '\n'.join(rows)


def soak(minutes: float, seed: int) -> list[Tally]:
    """Run rounds until the time is over; the sums of all rounds by kind."""
    sums: dict[str, Tally] = {}
    end_s = time.monotonic() + 60 * minutes
    number = seed
    while True:
        with tempfile.TemporaryDirectory() as name:
            for tally in one_round(Random(number), Path(name)):
                sums.setdefault(tally.kind, Tally(tally.kind)).add(tally)
                if not tally.skipped and not tally.sound():
                    print(f'seed {number}: {tally}', file=sys.stderr, flush=True)  # noqa: T201
                if time.monotonic() > end_s and number > seed:
                    return list(sums.values())
        number += 1
        if time.monotonic() > end_s:
            return list(sums.values())


def main() -> int:
    """Run the attack, and print the table; 1 if anything did not hold."""
    parser = argparse.ArgumentParser(description='Attack the filter, recordings and a live node.')
    parser.add_argument('--minutes', type=float, default=10.0, help='how long; at least one round is run')
    parser.add_argument('--seed', type=int, default=1, help='of the first round; each next round adds 1')
    options = parser.parse_args()
    tallies = soak(options.minutes, options.seed)
    print(table(tallies))  # noqa: T201
    return int(not all(each.skipped or each.sound() for each in tallies))


if __name__ == '__main__':
    sys.exit(main())
