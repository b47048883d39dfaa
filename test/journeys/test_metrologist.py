# SPDX-License-Identifier: Apache-2.0
"""The journey of a metrologist: a file of an instrument, a report with a verdict, and a cleaned file.

Each step is done on the command line, as a person would, and the report is opened in a browser.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from browser import browser
from examples import surface

from socialcircle_ros import CircleSettings, read_surface, remove_outliers, write_surface
from socialcircle_ros.formats import MeasuredSurface

pytest.importorskip('matplotlib')


def socialcircle(folder, *arguments):
    command = [sys.executable, '-m', 'socialcircle_ros.commands.main', *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope='module')
def measured(tmp_path_factory):
    """A file of an Alicona InfiniteFocus where the real measurements are, else a simulated x3p."""
    data = os.environ.get('SOCIALCIRCLE_DATA')
    if data:
        pytest.importorskip('SurfaceTopography')
        return Path(data) / 'vendor' / 'al3d-1.al3d'
    path = tmp_path_factory.mktemp('instrument') / 'part.x3p'
    write_surface(path, MeasuredSurface(1e-6 * surface(90, 70)[..., 2].astype(float), (2e-6, 3e-6), 'm'))
    return path


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('journey')


def test_the_file_becomes_a_report_with_a_verdict(folder, measured):
    done = socialcircle(
        folder, 'report', measured, '-o', 'report.html', '-p', 'circle.mode:=adaptive', '-p',
        'limits.outlier_share_max:=0.2', '-p', 'limits.measured_share_min:=0.5',
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert '1 of 1 measurement passed the limits.' in done.stdout
    failed = socialcircle(folder, 'report', measured, '-o', 'failed.html', '-p', 'limits.sz_max:=1e-12')
    assert failed.returncode == 3, failed.stderr
    assert f'Failed: {measured.name}: Sz is ' in failed.stderr


def test_the_report_can_be_read_and_printed(folder, measured):
    with browser() as chromium:
        page = chromium.new_page(viewport={'width': 1280, 'height': 900})
        page.goto((folder / 'report.html').as_uri())
        text = page.locator('body').inner_text()
        assert 'Passed: 1 of 1 measurements are within the limits.' in text
        assert page.get_by_role('heading', name=measured.name, exact=True).is_visible()
        assert '1970' not in text
        assert 'not known' not in text  # the file names its unit
        assert re.search(r'Sq \[(µm|nm)\]', text)
        page.get_by_role('link', name=measured.name).click()
        printed = page.pdf(prefer_css_page_size=True, print_background=True)
        assert len(re.findall(rb'/Type\s*/Page\b', printed)) == 2
        page.goto((folder / 'failed.html').as_uri())
        assert page.locator('.banner.failed').count() == 2


def test_the_cleaned_file_holds_the_kept_heights_and_their_unit(folder, measured):
    done = socialcircle(folder, 'filter', measured, '-o', 'cleaned.x3p', '-p', 'circle.mode:=adaptive')
    assert done.returncode == 0, done.stderr
    before, after = read_surface(measured), read_surface(folder / 'cleaned.x3p')
    removed = remove_outliers(before.heights, CircleSettings(mode='adaptive'), pitch=before.pitch).outliers
    expected = np.where(removed, np.nan, before.heights)
    assert (np.isfinite(after.heights) == np.isfinite(expected)).all()
    kept = np.isfinite(expected)
    assert (before.unit, after.unit) == ('m', 'm')
    np.testing.assert_allclose(after.heights[kept], expected[kept], rtol=1e-6)
