"""Control a page in a browser, for tests."""

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

PATIENCE = 600
"""Longest time for any action in the browser (s)."""

alone = pytest.mark.skipif(
    MPI.COMM_WORLD.size > 1, reason="a process that uses MPI cannot start a browser under mpirun"
)


class Page:
    """The report page in a browser."""

    def __init__(self, browser: Any, path: Path) -> None:
        self._browser = browser
        browser.get(path.as_uri())
        self.wait("document.getElementById('canvas').hasAttribute('data-ready')")

    def __call__(self, script: str) -> Any:
        return self._browser.execute_script(f"return {script}")

    def wait(self, condition: str) -> None:
        from selenium.webdriver.support.ui import WebDriverWait

        WebDriverWait(self._browser, PATIENCE, 0.05).until(lambda _: self(condition))

    def part(self, name: str) -> Any:
        return self._browser.find_element("id", name)

    def pixels(self) -> np.ndarray[Any, Any]:
        """Return the pixels of the canvas, shape (32, 32, 3)."""
        return np.array(
            self._browser.execute_async_script(
                """const done = arguments[0];
                requestAnimationFrame(() => requestAnimationFrame(() => {
                  const small = document.createElement("canvas");
                  small.width = small.height = 32;
                  const pen = small.getContext("2d");
                  pen.drawImage(document.getElementById("canvas"), 0, 0, 32, 32);
                  done(Array.from(pen.getImageData(0, 0, 32, 32).data));
                }));"""
            )
        ).reshape(32, 32, 4)[..., :3]

    def changed(self, before: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Return the pixels as soon as they differ from earlier pixels."""
        for _ in range(1000):
            now = self.pixels()
            if np.abs(now - before).max() > 20:
                return now
        raise AssertionError("the picture has not changed")

    def keys(self, name: str, *keys: str) -> None:
        self.part(name).send_keys(*keys)

    def choose(self, name: str, value: str) -> None:
        """Set a control of the page as a user does."""
        self._browser.execute_script(
            """const part = document.getElementById(arguments[0]);
            part.value = arguments[1];
            part.dispatchEvent(new Event("input"));
            part.dispatchEvent(new Event("change"));""",
            name,
            value,
        )
