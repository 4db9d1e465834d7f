# SPDX-License-Identifier: Apache-2.0
"""Picture docs/images/view.png: the page of `doorstate view`, coloured by the points that the packaged PointNet++ used.

python -m paper.pictures.view DATASET docs/images/view.png
"""

from __future__ import annotations

import sys
from pathlib import Path

from tests.headless_chromium import open_browser_page

from doorstate.inference.predictor import Predictor
from doorstate.viewer.cloud_page import make_entry, render_cloud_page
from doorstate.viewer.named_clouds import find_named_clouds

EVERY, SELECTED = 121, 27  # every 121st sample is listed, and the 27th of these is shown


def main(dataset: str, target: str) -> None:
    """Render the page of a prepared data set, and write a screenshot."""
    predictor = Predictor.load()
    readers = find_named_clouds([Path(dataset)])[::EVERY]
    html = render_cloud_page(predictor, [make_entry(predictor, read()) for read in readers])
    path = Path(target).resolve().with_suffix(".html")
    path.write_text(html, encoding="utf-8")
    with open_browser_page() as (page, _):
        page.set_viewport_size({"width": 1100, "height": 700})
        page.goto(f"{path.as_uri()}#{SELECTED}")
        page.wait_for_selector("#plot canvas")
        page.click("[data-color=channels]")
        page.wait_for_timeout(2000)  # until the cloud is drawn
        page.screenshot(path=target)
    path.unlink()


if __name__ == "__main__":
    main(*sys.argv[1:])
