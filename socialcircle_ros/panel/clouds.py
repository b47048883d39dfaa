"""The clouds of a recording, one at a time, forward and back."""

from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from types import TracebackType

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.recording import Message, open_recording
from socialcircle_ros.recording.offline import clouds_of


class RecordedClouds:
    """An opened recording as a list of clouds; a context manager that closes it.

    Only the cloud that is asked for is kept in memory. Opening reads the recording through once, because a
    recording does not say where its clouds are.

    Args:
        path: an MCAP file or a rosbag2 directory.

    Attributes:
        damage: None, or one sentence that says where the recording breaks off.

    Raises:
        RecordingError: it cannot be read, or has no clouds.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with ExitStack() as closing:
            self._reader = closing.enter_context(open_recording(path))
            self._topics = clouds_of(self._reader)
            if not self._topics:
                there = ', '.join(sorted(self._reader.topics)) or 'no topics'
                raise RecordingError(
                    f'{path} has no clouds ({point_cloud.TYPE}) to step through; it has: {there}. Frames of a'
                    ' stack become clouds with `socialcircle filter`.'
                )
            self._places: list[tuple[int, int]] = []  # log time, and which of the clouds of that time
            for message in self._reader.messages(self._topics):
                same = bool(self._places) and self._places[-1][0] == message.log_time
                self._places.append((message.log_time, self._places[-1][1] + 1 if same else 0))
            if not self._places:
                raise RecordingError(f'{path} has no message on {", ".join(self._topics)}.')
            self.damage = self._reader.damage
            self._closing = closing.pop_all()

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, number: int) -> Message:
        """The cloud of a number, from 0 on.

        Raises:
            IndexError: there is none.
            RecordingError: the recording can no longer be read.
        """
        time, place = self._places[number]
        found = next(islice(self._reader.messages(self._topics, since=time), place, None), None)
        if found is None:
            raise RecordingError(f'{self.path} has changed since it was opened; open it again.')
        return found

    def close(self) -> None:
        """Close the recording."""
        self._closing.close()

    def __enter__(self) -> 'RecordedClouds':  # noqa: PYI034 - Self is not in Python 3.10
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
