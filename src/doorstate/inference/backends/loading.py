# SPDX-License-Identifier: Apache-2.0
"""Backend of packaged weights or of a weights file."""

from __future__ import annotations

from pathlib import Path

from doorstate.errors import MissingExtraError, WeightsError
from doorstate.inference.backends.base import Backend
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.networks.packaged import packaged_weights


def load_backend(name_or_path: str | Path, threads: int | None = None) -> Backend:
    """Load packaged weights by name, or a `.safetensors` or `.onnx` file by path.

    Args:
        name_or_path: name of packaged weights, or path of a file.
        threads: processor threads of one call to onnxruntime; None: `default_threads()`.

    Raises:
        WeightsError: no such weights, or they cannot be used.
        MissingExtraError: torch or onnxruntime is needed and not installed.
    """
    path = Path(name_or_path)
    if path.suffix == ".onnx":
        return OnnxBackend(path, threads)
    if path.suffix != ".safetensors":
        if path.suffix or path.exists():
            raise WeightsError("not a weights file", path=path, expected=".safetensors or .onnx")
        path = packaged_weights(str(name_or_path))
    try:
        from doorstate.inference.backends.torch_backend import TorchBackend
        from doorstate.networks.weights import load_weights
    except ImportError as error:
        raise MissingExtraError(
            f"{path.name} needs the package {error.name}: install it, or use an exported .onnx file"
        ) from error
    return TorchBackend(*load_weights(path))
