"""The browser of these tests, which are skipped where there is none."""

from pathlib import Path

import pytest

from studies import browser


class Browser(browser.Browser):
    """One page of a headless Chromium."""

    def __init__(self, profile: Path):
        if browser.find_browser() is None:
            pytest.skip("no Chromium found: install chromium, or set TOWVAL_BROWSER to its path")
        super().__init__(profile)
