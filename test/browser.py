# SPDX-License-Identifier: Apache-2.0
"""A real browser for the tests of the tuning page: headless Chromium with WebGL in software."""

import atexit
import contextlib
import functools
import shutil

import pytest

CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser') or shutil.which('google-chrome')
SWITCHES = [
    '--disable-gpu-rasterization',
    '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader',
    '--ignore-gpu-blocklist',
    '--no-sandbox',
]
TIMEOUT_MS = 300_000  # a fresh checkout compiles meanwhile, and the pictures are rendered in software


@contextlib.contextmanager
def browser(*switches):
    """Chromium with further switches, or a skip that says what is missing."""
    playwright = pytest.importorskip(
        'playwright.sync_api', reason='browser tests need playwright: pip install ".[test]"'
    )
    pytest.importorskip('viser', reason='the page needs viser: pip install ".[panel]"')
    if CHROMIUM is None:
        pytest.skip('browser tests need Chromium: apt-get install chromium')
    chromium = _driver(playwright).chromium.launch(executable_path=CHROMIUM, args=[*SWITCHES, *switches])
    yield chromium
    chromium.close()


@functools.cache
def _driver(playwright):
    """The driver of Playwright: one for the process, because fixtures of several files may use it at once."""
    driver = playwright.sync_playwright().start()
    atexit.register(driver.stop)
    return driver


class Visitor:
    """A visitor of the page: reads its texts and uses its controls."""

    def __init__(self, chromium, address, width=1280, height=800, tab='Tune'):
        self.page = chromium.new_page(viewport={'width': width, 'height': height})
        self.page.set_default_timeout(TIMEOUT_MS)
        self.errors = []
        self.page.on('pageerror', lambda error: self.errors.append(str(error)))
        self.page.goto(address)
        if tab is not None:
            self.page.get_by_role('tab', name=tab).wait_for()

    def sees(self, text):
        """Wait until the page shows a text; return True so that it can be asserted."""
        self.page.get_by_text(text).locator('visible=true').first.wait_for()
        return True

    def no_longer_sees(self, text):
        self.page.get_by_text(text).locator('visible=true').wait_for(state='hidden')
        return True

    def row(self, label):
        """The row of the control with a label."""
        labels = self.page.locator('.mantine-Flex-root > div > p > label').get_by_text(label, exact=True)
        return labels.locator('xpath=ancestor::div[contains(@class, "mantine-Flex-root")][1]')

    def field(self, label):
        return self.row(label).locator('input:not([type=hidden])').first

    def slider(self, label):
        """The slider in the row of a label, or below it where the row holds a number that is typed."""
        own = self.row(label).locator('[role=slider]')
        below = self.row(label).locator('xpath=following::*[@role="slider"][1]')
        return own if own.count() else below

    def wait_until(self, label, value):
        """Wait until a field shows a value, also a field that is made meanwhile."""
        from playwright.sync_api import expect

        expect(self.field(label)).to_have_value(value, timeout=TIMEOUT_MS)
        return True

    def choose(self, label, option):
        self.field(label).click()
        self.page.get_by_role('option', name=option, exact=True).locator('visible=true').click()

    def press(self, name):
        self.page.get_by_role('button', name=name).click()

    def open_tab(self, name):
        self.page.get_by_role('tab', name=name).click()

    def leave(self):
        self.page.close()
        assert self.errors == []
