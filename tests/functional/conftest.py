"""A browser for pages."""

import shutil
from collections.abc import Iterator
from typing import Any

import pytest

from tests.functional.browser_page import PATIENCE

FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"),
)


@pytest.fixture
def browser() -> Iterator[Any]:
    """Chromium without a screen."""
    webdriver = pytest.importorskip("selenium.webdriver")
    service = pytest.importorskip("selenium.webdriver.chrome.service")
    program, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("no chromium and chromedriver to open the report with")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for flag in FLAGS:
        options.add_argument(flag)
    logs = {"browser": "ALL", "performance": "ALL"}
    options.set_capability("goog:loggingPrefs", logs)
    with webdriver.Chrome(options=options, service=service.Service(driver)) as window:
        window.set_script_timeout(PATIENCE)
        window.set_window_size(1000, 1000)
        yield window
