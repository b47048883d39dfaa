# SPDX-License-Identifier: Apache-2.0
"""The report in a browser: on the screen, enlarged, and printed."""

import re

import pytest
from browser import browser
from examples import cloud

from socialcircle_ros import make_report
from socialcircle_ros.messages import point_cloud
from socialcircle_ros.recording import RecordingWriter, ros_topic
from socialcircle_ros.settings import LimitSettings, OutputSettings, PipelineSettings

pytest.importorskip('matplotlib')

A4_MM, MARGIN_MM, PX_PER_MM = (210, 297), 12, 96 / 25.4


@pytest.fixture(scope='module')
def page(tmp_path_factory):
    """The report of two clouds, a wide and a tall one, with all that a page can hold."""
    folder = tmp_path_factory.mktemp('report')
    with RecordingWriter(folder / 'night.mcap') as writer:
        writer.add_topic(ros_topic('/points', point_cloud.TYPE))
        for number, shape in enumerate([(50, 90), (110, 60)]):
            writer.write('/points', cloud(*shape, stamp=number + 1), number)
    limits = LimitSettings(outlier_share_max=0.001, sz_max=1.0, sq_max=0.1, measured_share_min=1.0)
    settings = PipelineSettings(limits=limits, output=OutputSettings(repaired=True))
    make_report(folder / 'night.mcap', folder / 'report.html', settings)
    with browser() as chromium:
        opened = chromium.new_page(viewport={'width': 1280, 'height': 800})
        opened.goto((folder / 'report.html').as_uri())
        yield opened


@pytest.mark.parametrize('width', [1280, 1920])
def test_the_page_fits_the_screen(page, width):
    page.set_viewport_size({'width': width, 'height': 900})
    assert page.evaluate('document.documentElement.scrollWidth') == width
    assert page.evaluate('[...document.images].filter(each => each.src).every(each => each.naturalWidth > 0)')


def test_a_click_enlarges_a_picture_and_another_one_closes_it(page):
    page.set_viewport_size({'width': 1280, 'height': 800})
    page.locator('button.enlarge').first.click()
    box = page.locator('dialog img').bounding_box()
    assert box['height'] > 600
    page.locator('dialog').click()
    assert not page.locator('dialog').is_visible()


def test_each_measurement_is_printed_whole_on_one_sheet(page):
    printed = page.pdf(prefer_css_page_size=True, print_background=True)
    assert len(re.findall(rb'/Type\s*/Page\b', printed)) == 3  # the summary, and two measurements
    page.emulate_media(media='print')
    width, height = (round((side - 2 * MARGIN_MM) * PX_PER_MM) for side in A4_MM)
    page.set_viewport_size({'width': width, 'height': 900})
    try:
        assert page.evaluate('document.documentElement.scrollWidth') <= width
        sheets = page.evaluate("[...document.querySelectorAll('.sheet')].map(each => each.offsetHeight)")
        assert len(sheets) == 2
        assert max(sheets) <= height
    finally:
        page.emulate_media(media='screen')
