"""Define a browser for pages, and compare the refusals of check and run."""

import shutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from perfplast_fenicsx.cli import run as cli_run
from perfplast_fenicsx.cli.recorder import Recorder, RunContext
from perfplast_fenicsx.errors import InputError
from perfplast_fenicsx.io.results.result_files import KNOWN
from tests.functional.browser_page import PATIENCE

FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"),
)

LOGS = ("browser", "performance")


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """Return Chromium without a screen."""
    webdriver = pytest.importorskip("selenium.webdriver")
    service = pytest.importorskip("selenium.webdriver.chrome.service")
    program, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("no chromium and chromedriver to open the report with")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for flag in FLAGS:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", dict.fromkeys(LOGS, "ALL"))
    with webdriver.Chrome(options=options, service=service.Service(driver)) as window:
        window.set_script_timeout(PATIENCE)
        yield window


@pytest.fixture
def browser(chromium: Any) -> Iterator[Any]:
    """Return a new window of Chromium, because settings such as dark mode belong to a window."""
    first = chromium.current_window_handle
    chromium.switch_to.new_window("window")
    chromium.set_window_size(1000, 1000)
    for log in LOGS:
        chromium.get_log(log)
    yield chromium
    chromium.close()
    chromium.switch_to.window(first)


@pytest.fixture(autouse=True)
def run_refuses_nothing_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail if ``run`` refuses, before its first solve, a case that ``check`` accepts.

    ``check`` and ``run`` make the same tests (:func:`perfplast_fenicsx.cli.run.admitted_solver`). A
    control may refuse a case later only for a reason that appears in a step of an algorithm.
    """
    steps: list[object] = []
    solve = cli_run._solve

    def counted(context: RunContext, *how: Any) -> int:
        steps.clear()
        try:
            return solve(context, *how)
        except InputError as error:
            goes_on = context.saved.reports or context.folder.file(KNOWN).exists()
            if not steps and not goes_on:  # check does not look at files of an earlier run
                pytest.fail(f"run refuses what check has not seen: {error}")
            raise

    def noticed(record: Callable[..., None]) -> Callable[..., None]:
        def notice(recorder: Recorder, step: Any) -> None:
            steps.append(step)
            record(recorder, step)

        return notice

    monkeypatch.setattr(cli_run, "_solve", counted)
    for name in ("iteration", "interior"):
        monkeypatch.setattr(Recorder, name, noticed(getattr(Recorder, name)))
