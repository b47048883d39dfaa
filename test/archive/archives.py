# SPDX-License-Identifier: Apache-2.0
"""Small archives, and an object store on this machine, for the tests of batches."""

from contextlib import contextmanager
from pathlib import Path

from examples import cloud

from socialcircle_ros.archive.ledger import Ledger
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.recording.topics import MetadataRecord

NOON = 1_790_000_000_000_000_000
BAGS = Path(__file__).resolve().parents[2] / 'bags'


def recorded(path, *, seed=0, clouds=2, namespace='/cell1', metadata=None, message=None):
    """A recording of clouds with 26 outliers each, and at most one more that is removed with them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with RecordingWriter(path) as writer:
        if metadata is not None:
            writer.add_metadata(MetadataRecord('part', metadata))
        writer.add_topic(ros_topic(f'{namespace}/points', point_cloud.TYPE))
        for number in range(clouds):
            time = NOON + number * 1_000_000_000
            data = message or cloud(seed=100 * seed + number, stamp=time)
            writer.write(f'{namespace}/points', data, time)
    return path


@contextmanager
def object_store(monkeypatch):
    """A bucket `plant` of an S3 server on this machine, as its file system; s3fs finds it by the environment."""
    import s3fs
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer('127.0.0.1', 0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        monkeypatch.setenv('AWS_ENDPOINT_URL', f'http://{host}:{port}')
        for name in ('AWS_ACCESS_KEY_ID', 'AWS_SECRET_ACCESS_KEY'):
            monkeypatch.setenv(name, 'test')
        monkeypatch.setenv('AWS_DEFAULT_REGION', 'us-east-1')
        s3fs.S3FileSystem.clear_instance_cache()  # those of another test know another port
        files = s3fs.S3FileSystem(skip_instance_cache=True)
        files.mkdir('plant')
        yield files
        files.rm('plant', recursive=True)  # moto keeps it for the next server of this process
    finally:
        s3fs.S3FileSystem.clear_instance_cache()
        server.stop()


def in_between(monkeypatch, step, other):
    """Do another task before a step of the next one, as a second worker may."""
    from socialcircle_ros.archive import work

    owner, name = (work.Ledger, 'record') if step == 'record' else (work, step)
    original = getattr(owner, name)

    def after_the_other(*given, **options):
        monkeypatch.setattr(owner, name, original)
        assert work.do_task(other).entry.failure is None
        return original(*given, **options)

    monkeypatch.setattr(owner, name, after_the_other)


def all_is_there(output):
    """Whether a folder of results holds what its ledger says, and nothing else; all entries are of ended runs."""
    entries = list(Ledger(output).entries())
    files = (each for name in ('recordings', 'measurements') for each in (output / name).rglob('*.*'))
    there = {str(each.relative_to(output)) for each in files if each.is_file()}
    return there == {name for entry in entries for name in entry.made()} and all(each.digest for each in entries)
