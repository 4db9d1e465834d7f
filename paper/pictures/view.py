# SPDX-License-Identifier: Apache-2.0
"""docs/images/view.png: what `doorstate view` shows in Chromium, coloured by what the packaged PointNet++ looked at.

python tools/view_picture.py docs/images/view.png
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from doorstate_command import REPOSITORY, doorstate

EVERY, SHOWN = 121, 27  # of the published samples; the number in the list


def main(target: str) -> None:
    """Make the page, choose a cloud and a colour, and take the picture."""
    sys.path.insert(0, str(REPOSITORY / "tests"))
    from headless_chromium import Browser

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        page = folder / "view.html"
        doorstate(f"view results/ogurob-4096 --every {EVERY} --no-open --out {page}")
        with Browser(folder / "profile") as browser:
            size = {"width": 1100, "height": 700, "deviceScaleFactor": 1}
            browser.call("Emulation.setDeviceMetricsOverride", **size, mobile=False)
            browser.open(f"{page.as_uri()}#{SHOWN}")
            browser.wait_until("document.querySelector('#plot canvas') !== null")
            browser.click("[data-color=channels]")
            before, now = b"", browser.screenshot()
            while before != now:  # until it has been drawn
                before, now = now, browser.screenshot()
        Path(target).write_bytes(now)


if __name__ == "__main__":
    main(*sys.argv[1:])
