# SPDX-License-Identifier: Apache-2.0
"""Description of the machine."""

from __future__ import annotations

import json

import torch

from doorstate.training.environment import describe_environment


def test_environment_is_json_with_versions_and_threads() -> None:
    environment = describe_environment()
    assert environment["torch"] == torch.__version__
    assert environment["threads"] == torch.get_num_threads()
    assert environment["processor"]
    assert json.loads(json.dumps(environment)) == environment
