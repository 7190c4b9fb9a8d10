"""A page in a browser that has no network: what it fetched, what the browser complained about, what it computed."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np

SIGNALS = """() => {  // the record, as text
  const { plan, run } = gapsense;
  const all = new Float64Array(plan.signals.length * run.rows);
  plan.signals.forEach(([name], k) => all.set(run.signals[name], k * run.rows));
  let text = "";
  const bytes = new Uint8Array(all.buffer);
  for (let k = 0; k < bytes.length; k += 8192) text += String.fromCharCode(...bytes.subarray(k, k + 8192));
  return btoa(text);
}"""
METRICS = "() => gapsense.plan.metrics.map((m) => measure(m, gapsense.run, gapsense.plan))"
PATIENCE = 120_000  # ms, on a machine that does much else


class Opened:
    """A page; each change waits for the run that it causes."""

    def __init__(self, browser: Any, file: Path, scheme: str = "light", width: int = 1280, link: str = "") -> None:
        self.context = browser.new_context(
            viewport={"width": width, "height": 844}, color_scheme=scheme, offline=True, accept_downloads=True
        )
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.fetched: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.fetched.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None)
        self.page.goto(file.as_uri() + link)
        self.wait(1)

    def wait(self, runs: int) -> None:
        """Until so many runs were shown."""
        self.page.wait_for_function(f"() => Number(document.documentElement.dataset.runs) >= {runs}")

    def runs(self) -> int:
        return int(self.page.evaluate("document.documentElement.dataset.runs"))

    def change(self, do: Any) -> None:
        """Do something that causes a run, and wait for it."""
        runs = self.runs()
        do()
        self.wait(runs + 1)

    def type(self, name: str, text: str) -> None:
        self.page.get_by_label(f"{name}, ").and_(self.page.locator("[type=text]")).fill(text)

    def problem(self) -> str:
        return self.page.locator("#problem").text_content()

    def signals(self) -> dict[str, np.ndarray]:
        """Recorded signals, with their bits."""
        names = self.page.evaluate("gapsense.plan.signals.map(([name]) => name)")
        numbers = np.frombuffer(base64.b64decode(self.page.evaluate(SIGNALS)))
        return dict(zip(names, numbers.reshape(len(names), -1)))

    def again(self, times: int) -> list[float]:
        """Milliseconds of the same run, done so often."""
        found = []
        for _ in range(times):
            self.change(lambda: self.page.click("#reset"))
            found.append(self.page.evaluate("gapsense.run.milliseconds"))
        return found

    def close(self) -> None:
        self.context.close()
