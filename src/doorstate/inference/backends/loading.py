# SPDX-License-Identifier: Apache-2.0
"""Backend of packaged weights or of a weights file."""

from __future__ import annotations

from pathlib import Path

from doorstate._devices import check_device_name, resolve_device
from doorstate.errors import ConfigError, WeightsError, is_installed, needs_extra, unknown_name
from doorstate.inference.backends.base import Backend
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.networks.packaged import packaged_graph, packaged_weights

BACKENDS = ("onnxruntime", "torch")


def needs_torch(name_or_path: str | Path, backend: str | None = None, device: str = "cpu") -> bool:
    """Return True if `load_backend` imports torch for this network, or looks for a CUDA device; imports nothing."""
    path = Path(name_or_path)
    is_named = path.suffix == ".safetensors" or backend == "torch" or device != "cpu"
    return is_named and _can_be_torch(path, backend)


def load_backend(
    name_or_path: str | Path, threads: int | None = None, backend: str | None = None, device: str = "cpu"
) -> Backend:
    """Load packaged weights by name, or a `.safetensors` or `.onnx` file by path.

    Args:
        name_or_path: name of packaged weights, or path of a file.
        threads: processor threads of one call to onnxruntime; None: `default_threads()`.
        backend: one of `BACKENDS`; None: torch for a `.safetensors` file or a CUDA device, else onnxruntime.
        device: as for `Predictor.load`; onnxruntime runs on the processor alone.

    Raises:
        ConfigError: the backend cannot run this kind of file, or not on the device, or there is no such device.
        WeightsError: no such weights, or they cannot be used.
        MissingExtraError: torch is needed and not installed.
    """
    if backend not in (None, *BACKENDS):
        raise unknown_name("backend", str(backend), BACKENDS, field="backend")
    path = Path(name_or_path)
    place = _torch_device(device, _can_be_torch(path, backend))
    if place != "cpu":
        backend = "torch"
    if path.suffix == ".onnx":
        if backend == "torch":
            raise ConfigError("torch cannot run an .onnx file", field="backend")
        return OnnxBackend(path, threads)
    if path.suffix == ".safetensors":
        if backend == "onnxruntime":
            raise ConfigError("onnxruntime needs an exported .onnx file", field="backend")
        return _load_torch(path, place)
    if path.suffix or path.exists():
        raise WeightsError("not a weights file", path=path, expected=".safetensors or .onnx")
    name = str(name_or_path)
    if backend == "torch":
        return _load_torch(packaged_weights(name), place)
    return OnnxBackend(packaged_graph(name), threads, weights=packaged_weights(name))


def _can_be_torch(path: Path, backend: str | None) -> bool:
    return path.suffix != ".onnx" and backend != "onnxruntime"


def _torch_device(device: str, can_be_torch: bool) -> str:
    """Return "cpu", or the name of a CUDA device that is there.

    Raises:
        ConfigError: there is none, or one is named and torch cannot run the network.
    """
    if check_device_name(device) == "cpu" or (
        device == "auto" and not (can_be_torch and is_installed("torch"))
    ):
        return "cpu"
    if not can_be_torch:
        raise ConfigError(
            "onnxruntime runs on the processor",
            field="device",
            expected="cpu",
            hint="give .safetensors weights",
        )
    with needs_extra(f"device {device}"):
        return str(resolve_device(device))


def _load_torch(path: Path, device: str) -> Backend:
    if not path.exists():
        raise WeightsError("no such weights file", path=path)
    with needs_extra(path.name):
        from doorstate.inference.backends.torch_backend import TorchBackend
        from doorstate.networks.weights import load_weights
    return TorchBackend(*load_weights(path), device=device)
