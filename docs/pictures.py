# SPDX-License-Identifier: Apache-2.0
"""Draws the pictures of the documents and of the README, as the program draws them now.

    python docs/pictures.py                      # all of them, in some ten minutes
    python docs/pictures.py tune.png trend.png   # these

| picture | from |
| --- | --- |
| metal_groove.png | a simulated groove, filtered |
| growth.png | the table in docs/benchmarks.md, which `socialcircle bench --growth` measures |
| trend.png | the archive of docs/make_archive.py, and the page of `socialcircle trend` in Chromium |
| tune.png | a node, a simulated focus stack, and the page of `socialcircle tune` in Chromium |
| learned_curve.png | docs/learned_curve.csv, which the training writes (`curve.csv`) |
| learned_worst.png | `socialcircle experiment learned --seeds 401`, with $SOCIALCIRCLE_DATA |
"""

import csv
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image

from socialcircle_ros import remove_outliers
from socialcircle_ros.clients.process import NodeProcess
from socialcircle_ros.pictures.drawings import before_and_after
from socialcircle_ros.pictures.style import few_colours
from socialcircle_ros.simulation import make_scene
from socialcircle_ros.storage import write_file
from socialcircle_ros.studies.bench.growth import GrowthPoint, draw_growth
from socialcircle_ros.studies.learned.drawings import learning_curve

if TYPE_CHECKING:
    from playwright.sync_api import Page

DOCS = Path(__file__).resolve().parent
_CELL = '/cell1'
_GROWTH_ROW = re.compile(r'^\| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| [\d.]+ \|$', re.MULTILINE)
_SHAPE = 3 / 4  # of the clouds of the growth: rows to columns
_WAIT_MS = 300_000
_REGION = 60, 45  # half of its sides, in pixels of the screen
_WORST = 10


def main(names: list[str]) -> None:
    """Draw some pictures, or all."""
    unknown = set(names) - set(PICTURES)
    if unknown:
        sys.exit(f'There is no picture {", ".join(sorted(unknown))}; there are {", ".join(PICTURES)}.')
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    for name in names or PICTURES:
        print(f'{name} …', flush=True)  # noqa: T201 - a program
        with tempfile.TemporaryDirectory() as folder:
            PICTURES[name](DOCS / name, Path(folder))


def metal_groove(path: Path, _: Path) -> None:
    """A groove of 640×480 points as measured, its outliers, and filtered."""
    xyz = make_scene('metal_groove', 480, 640, seed=1).points
    outliers = remove_outliers(xyz).outliers
    title = f'{np.count_nonzero(outliers) / outliers.size:.1%} of the points of a milled groove are outliers'
    before_and_after(path, xyz, outliers, title, 'um')


def growth(path: Path, _: Path) -> None:
    """Time over points, from the table of docs/benchmarks.md."""
    points = []
    for row in _GROWTH_ROW.findall((DOCS / 'benchmarks.md').read_text(encoding='utf-8')):
        millions, vote_ms, circle_ms = map(float, row)
        rows = round((1e6 * millions * _SHAPE) ** 0.5)
        points.append(GrowthPoint(rows, round(1e6 * millions / rows), vote_ms=vote_ms, circle_ms=circle_ms))
    draw_growth(points, path)


def trend(path: Path, folder: Path) -> None:
    """The page of trends of the example in docs/archives.md."""
    subprocess.run([sys.executable, DOCS / 'make_archive.py', 'nights'], cwd=folder, check=True)  # noqa: S603
    names = '{cell}/{part}_*.mcap'
    _socialcircle(folder, 'batch', 'nights', '-o', 'out', '--no-recordings', '--names', names, expected=1)
    _socialcircle(folder, 'trend', 'out', '-o', 'trend.html')
    page_file = folder / 'trend.html'
    page_file.write_text(page_file.read_text(encoding='utf-8').replace(str(folder), '…'), encoding='utf-8')
    with _chromium(1280, 1550) as page:
        page.goto(page_file.as_uri())
        page.get_by_role('combobox').select_option('cell3, lid')
        page.locator('canvas').first.wait_for()
        write_file(path, _small(page.screenshot()))


def tune(path: Path, folder: Path) -> None:
    """The tuning page: a focus stack, a region of interest, why a point is an outlier, and its focus curve."""
    _socialcircle(folder, 'simulate', 'ball', '-o', 'ball.mcap', '--size', '160', '200')
    parameters = ('--params-file', str(folder / 'ball.yaml'))
    with (
        NodeProcess(_CELL, folder / 'node.log', arguments=parameters),
        _tuning_page(folder) as address,
        _chromium(1920, 1080) as page,
    ):
        page.goto(address)
        page.get_by_text('Showing').locator('visible=true').first.wait_for()
        notice = page.locator('.mantine-Notification-closeButton')  # on WebGL in software; it hides a part
        notice.first.wait_for()
        notice.first.click()
        page.get_by_role('button', name='from above').click()
        across, up = _outlier_on_screen(page)
        page.get_by_role('button', name='Look at a region').click()
        page.get_by_text('Drag a rectangle').locator('visible=true').wait_for()
        page.mouse.move(across - _REGION[0], up - _REGION[1])
        page.mouse.down()
        page.mouse.move(across + _REGION[0], up + _REGION[1], steps=5)
        page.mouse.up()
        page.get_by_text('Region: rows').locator('visible=true').wait_for()
        page.mouse.click(across, up)
        page.get_by_role('button', name='Focus curve of this point').click()
        page.get_by_text('focus curve: ').locator('visible=true').wait_for()
        page.get_by_role('button', name='3D').click()
        page.get_by_role('tab', name='Tune').click()
        page.get_by_text('heights, number of points').scroll_into_view_if_needed()
        page.wait_for_timeout(3000)  # the view turns
        write_file(path, _small(page.screenshot()))


def learned_curve(path: Path, _: Path) -> None:
    """The loss of the packaged weights over the steps of their training."""
    with (DOCS / 'learned_curve.csv').open(encoding='utf-8') as file:
        rows = [(int(row['step']), float(row['loss'])) for row in csv.DictReader(file)]
    write_file(path, learning_curve(*zip(*rows, strict=True)))


def learned_worst(path: Path, folder: Path) -> None:
    """The clouds that the network judges worst, one below the other."""
    _socialcircle(folder, 'experiment', 'learned', '--seeds', '401', '-o', 'learned')
    with (folder / 'learned/learned_surfaces.csv').open(encoding='utf-8') as file:
        names = {f'learned_{row["surface"]}' for row in csv.DictReader(file)}
    # The experiment writes one picture for each of the worst clouds, the worst one first.
    found = sorted(folder.glob('learned/learned_*.png'), key=lambda each: each.stat().st_mtime_ns)
    strips = [Image.open(each).convert('RGB') for each in found if each.stem in names][:_WORST]
    width = max(strip.width for strip in strips)
    whole = Image.new('RGB', (width, sum(strip.height for strip in strips)), 'white')
    top = 0
    for strip in strips:
        whole.paste(strip, (0, top))
        top += strip.height
    whole.thumbnail((1200, 100_000))
    write_file(path, few_colours(whole))


def _small(png: bytes) -> bytes:
    return few_colours(Image.open(io.BytesIO(png)).convert('RGB'))


PICTURES: dict[str, Callable[[Path, Path], None]] = {
    'metal_groove.png': metal_groove,
    'growth.png': growth,
    'trend.png': trend,
    'tune.png': tune,
    'learned_curve.png': learned_curve,
    'learned_worst.png': learned_worst,
}
"""Name of each picture, and what draws it: a function of its path and of a folder for its work."""


def _socialcircle(folder: Path, *arguments: str, expected: int = 0) -> None:
    command = [sys.executable, '-m', 'socialcircle_ros.commands.main', *arguments]
    code = subprocess.run(command, cwd=folder, check=False).returncode  # noqa: S603
    if code != expected:
        sys.exit(f'socialcircle {" ".join(arguments)} ended with {code} instead of {expected}.')


@contextmanager
def _tuning_page(folder: Path) -> Iterator[str]:
    """The address of the page, which opens the recording for the node of the cell."""
    command = [sys.executable, '-m', 'socialcircle_ros.commands.main', 'tune', 'ball.mcap', _CELL, '--port', '0']
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)  # noqa: S603
    try:
        assert process.stdout is not None  # noqa: S101 - a pipe was asked for
        for line in process.stdout:
            if address := re.search(r'http://\S+?(?=;)', line):
                yield address[0]
                break
    finally:
        process.terminate()
        process.wait()


@contextmanager
def _chromium(width: int, height: int) -> Iterator['Page']:
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - an extra

    switches = ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--no-sandbox']
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which('chromium'), args=switches)
        page = browser.new_page(viewport={'width': width, 'height': height})
        page.set_default_timeout(_WAIT_MS)
        yield page
        browser.close()


def _outlier_on_screen(page: 'Page') -> tuple[float, float]:
    """Where the scene shows the largest group of outliers: the middle of the densest red square."""
    box = page.locator('canvas').first.bounding_box()
    assert box is not None  # noqa: S101 - it is visible
    before = None
    for _ in range(120):
        page.wait_for_timeout(500)  # the view turns, and there is no event at its end
        shown = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert('RGB')).astype(int)
        red: npt.NDArray[np.bool_] = (shown[..., 0] > 150) & (shown[..., 1] < 40) & (shown[..., 2] < 40)
        side = 16
        rows, columns = (length // side for length in red.shape)
        squares = red[: rows * side, : columns * side].reshape(rows, side, columns, side).sum(axis=(1, 3))
        left, right = int(box['x'] + box['width'] * 0.25) // side, int(box['x'] + box['width'] * 0.75) // side
        squares[:, :left], squares[:, right:] = 0, 0
        row, column = np.unravel_index(int(squares.argmax()), squares.shape)
        found = (float(column) + 0.5) * side, (float(row) + 0.5) * side
        if squares[row, column] > side * side // 2 and found == before:
            return found
        before = found
    sys.exit('The scene shows no outlier.')


if __name__ == '__main__':
    main(sys.argv[1:])
