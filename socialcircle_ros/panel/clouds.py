"""Random access to the clouds of a recording."""

from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from types import TracebackType

from socialcircle_ros.errors import RecordingError
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.recording import Message, open_recording
from socialcircle_ros.recording.offline import clouds_of


class RecordedClouds:
    """An open recording as a sequence of clouds; a context manager that closes it.

    One cloud at a time is read into memory. Opening reads the whole recording once to find its clouds.

    Args:
        path: an MCAP file or a rosbag2 directory.

    Attributes:
        path: of the recording.
        damage: one sentence that says where the recording breaks off; None: it is complete.

    Raises:
        RecordingError: it cannot be read, or has no clouds.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with ExitStack() as closing:
            self._reader = closing.enter_context(open_recording(path))
            self._topics = clouds_of(self._reader)
            if not self._topics:
                topics = ', '.join(sorted(self._reader.topics)) or 'no topics'
                raise self._reader.refusal(
                    f'{path} has no clouds ({point_cloud.TYPE}) to step through; it has: {topics}. Convert the'
                    ' frames of a stack to clouds with `socialcircle filter`.'
                )
            self._places: list[tuple[int, int]] = []  # log time, and index among the clouds of that time
            for message in self._reader.messages(self._topics):
                same_time = bool(self._places) and self._places[-1][0] == message.log_time
                self._places.append((message.log_time, self._places[-1][1] + 1 if same_time else 0))
            if not self._places:
                raise self._reader.refusal(f'{path} has no message on {", ".join(self._topics)}.')
            self.damage = self._reader.damage
            self._closing = closing.pop_all()

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, number: int) -> Message:
        """Read one cloud, counted from 0.

        Raises:
            IndexError: there is no such cloud.
            RecordingError: the recording can no longer be read.
        """
        log_time, place = self._places[number]
        found = next(islice(self._reader.messages(self._topics, since=log_time), place, None), None)
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
