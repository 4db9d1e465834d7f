# SPDX-License-Identifier: Apache-2.0
"""Number of processor threads, and settings of torch in programs."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from doorstate.inference.backends import threads
from doorstate.inference.backends.threads import default_threads


@pytest.mark.parametrize(
    ("value", "processors", "expected"), [("3", 8, 3), ("", 8, 4), ("", 1, 1), ("0", 2, 2), ("4,2", 2, 2)]
)
def test_default_is_of_the_environment_or_at_most_four(
    monkeypatch: pytest.MonkeyPatch, value: str, processors: int, expected: int
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", value)
    monkeypatch.setattr(threads, "default_workers", lambda: processors)
    assert default_threads() == expected


@pytest.mark.parametrize(("policy", "expected"), [(None, "PASSIVE"), ("ACTIVE", "ACTIVE")])
def test_waiting_threads_sleep_unless_the_user_decides(policy: str | None, expected: str) -> None:
    code = (
        "import os, sys; from doorstate.inference.backends.threads import configure_torch;"
        "configure_torch(None, used=False); assert 'torch' not in sys.modules;"
        "configure_torch(1, used=True); print(os.environ['OMP_WAIT_POLICY'], sys.modules['torch'].get_num_threads())"
    )
    environment = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    environment |= {} if policy is None else {"OMP_WAIT_POLICY": policy}
    out = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout
    assert out.split() == [expected, "1"]
