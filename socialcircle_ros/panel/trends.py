# SPDX-License-Identifier: Apache-2.0
"""The page of trends of a folder of measurements, and the reports that it links to. No viser."""

import threading
from pathlib import Path
from urllib.parse import unquote

from socialcircle_ros.storage import is_url

PAGE = 'trend.html'
"""Path of the page of trends, from the folder that is served."""

_REPORTS = 'reports'


class Trends:
    """The trends that a visitor has asked for last. Its methods may be called from any thread.

    Attributes:
        folder: of the measurements, or its URL; '': nobody has asked yet.
        drifts: one sentence for each cell and part that drifts.
    """

    def __init__(self) -> None:
        self.folder = ''
        self.drifts: tuple[str, ...] = ()
        self._page = b''
        self._making = threading.Lock()

    def make(self, folder: str) -> None:
        """Make the page of a folder; nothing is written there.

        Args:
            folder: output of `socialcircle batch`, or `measurements.folder` of nodes; its path or URL.

        Raises:
            SocialCircleError: the folder has no measurements, or a library is not installed.
        """
        from socialcircle_ros.archive.trend import drift_sentences  # noqa: PLC0415 - needs extras
        from socialcircle_ros.archive.trend_page import trend_page  # noqa: PLC0415

        place = folder if is_url(folder) else str(Path(folder).expanduser())
        with self._making:
            page, all_series = trend_page(place, Path(place) / PAGE)
            self._page = page.encode()
            self.drifts = tuple(drift_sentences(all_series))
            self.folder = place

    def read(self, path: str) -> bytes | None:
        """The page of trends or one of the reports beside it; None: there is no such file, or it is none of these.

        Args:
            path: from the folder of the measurements, as a browser asks for it.
        """
        if not self.folder:
            return None
        if path == PAGE:
            return self._page
        folder, _, name = unquote(path).partition('/')
        if folder != _REPORTS:
            return None
        try:
            reports = (Path(self.folder) / _REPORTS).resolve()
            report = (reports / name).resolve()  # that to which links lead
            is_report = report.is_relative_to(reports) and report.suffix == '.html' and report.is_file()
            return report.read_bytes() if is_report else None
        except (OSError, ValueError, RuntimeError):  # a name with a zero byte; links in a circle
            return None
