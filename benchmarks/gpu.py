# SPDX-License-Identifier: Apache-2.0
"""Check of a device: networks against those of the processor, and the times of everything that runs there.

Outputs and gradients are compared relative to their norm. In float64 no rounding changes which point wins a maximum or
is a neighbour; in float32 one can, which moves a gradient by up to 15 % of its norm (docs/speed.md).
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from benchmarks.clouds import Clouds, simulated_clouds
from benchmarks.forms import PLAIN, PORT, Form
from benchmarks.measured_network import MeasuredNetwork, NetworkTask, OperationCount
from benchmarks.store import Result
from benchmarks.timing import MatrixSpeed, median_seconds
from doorstate._devices import has_fast_bf16
from doorstate.clouds.device_sampling import farthest_points
from doorstate.errors import summarize_exception
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.kernels.ball_query import ball_query
from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.knn import knn
from doorstate.networks.kernels.neighbour_max import neighbour_max

TOLERANCES = {"float64": (1e-7, 1e-6), "float32": (1e-2, 0.15)}
"""Largest relative difference of outputs and of gradients, by type of number."""
_PARITY_CLOUDS, _PARITY_POINTS = 4, 1024
_BATCH, _POINTS = 16, 4096
_SMALL = 160  # points of a quick check
_CHANNELS = 64
_COPIED_VALUES = 2**27


def check_gpu(
    device: torch.device, networks: Sequence[str], checkouts: dict[str, Path], quick: bool, seconds: float
) -> dict[str, list[Result]]:
    """Return the results by part: parity, peaks, kernels, networks, simulation; what failed, and what had no time left.

    Args:
        device: device to check.
        networks: names of networks.
        checkouts: checkouts of ports by network.
        quick: use few small clouds.
        seconds: time after which no further measurement starts.
    """
    batch, num_points = (2, _SMALL) if quick else (_BATCH, _POINTS)
    clouds = simulated_clouds(max(batch, _PARITY_CLOUDS), num_points)
    parity_points = min(num_points, _PARITY_POINTS)
    small = torch.from_numpy(clouds.first_points(parity_points).points[:_PARITY_CLOUDS])
    labels = torch.from_numpy(clouds.labels[:_PARITY_CLOUDS])
    tasks: list[tuple[str, str, Callable[[], list[Result]]]] = [
        *(("parity", name, lambda name=name: [compare(name, small, labels, device)]) for name in networks),
        ("peaks", "peaks", lambda: measure_peaks(device, quick)),
        ("kernels", "kernels", lambda: measure_kernels(clouds.first_points(num_points), batch, device)),
        *(
            (
                "networks",
                name,
                lambda name=name: measure_forms(
                    name, clouds.first_points(num_points), batch, device, checkouts.get(name)
                ),
            )
            for name in networks
        ),
        ("simulation", "simulation", lambda: measure_rendering(device, quick)),
    ]
    results: dict[str, list[Result]] = {
        part: [] for part in [*(task[0] for task in tasks), "failed", "left_out"]
    }
    started = time.perf_counter()
    for part, name, measure in tasks:
        if part != "parity" and time.perf_counter() - started > seconds:
            results["left_out"].append({"part": part, "name": name})
            continue
        try:
            results[part] += measure()
        except Exception as error:  # a driver may raise anything
            results["failed"].append({"part": part, "name": name, "reason": summarize_exception(error)})
    return results


def compare(name: str, points: Tensor, labels: Tensor, device: torch.device) -> Result:
    """Return the largest relative differences of a network on the device from the same on the processor."""
    torch.manual_seed(0)
    network = create_network(name)
    row: Result = {"network": name, "points": points.shape[1], "is_within_tolerance": True}
    for kind, (most_of_outputs, most_of_gradients) in TOLERANCES.items():
        dtype = getattr(torch, kind)
        expected, got = (
            _training_step(copy.deepcopy(network).to(place, dtype), points.to(place, dtype), labels.to(place))
            for place in (torch.device("cpu"), device)
        )
        outputs = max(_difference(got[0][key], value) for key, value in expected[0].items())
        gradients = _difference(got[1], expected[1])
        row[kind] = {"outputs": outputs, "gradients": gradients}
        row["is_within_tolerance"] &= outputs <= most_of_outputs and gradients <= most_of_gradients
    return row


def measure_peaks(device: torch.device, quick: bool) -> list[Result]:
    """Return the speeds of a matrix product and of a copy."""
    speed = MatrixSpeed(torch.get_num_threads(), str(device))
    values = torch.zeros(2**20 if quick else _COPIED_VALUES, device=device)
    seconds = median_seconds(lambda: values.clone(), device=str(device))
    return [
        {
            "fp32_tflops": speed.gflops(bf16=False) / 1000,
            "bf16_tflops": speed.gflops(bf16=True) / 1000 if has_fast_bf16(device) else None,
            "copy_gb_per_s": 2 * values.numel() * values.element_size() / seconds / 1e9,
        }
    ]


def measure_forms(
    network: str, clouds: Clouds, batch: int, device: torch.device, checkout: Path | None
) -> list[Result]:
    """Return training and inference of the forms of a network, in ms per cloud and TFLOP/s of the training."""
    forms = [Form("fast fp32", "fast"), PLAIN]
    forms += [Form("fast bf16", "fast", bf16=True)] if has_fast_bf16(device) else []
    forms += [] if checkout is None else [PORT]
    gflop = OperationCount(network, clouds).training_gflop()
    rows = []
    for form in forms:
        task = NetworkTask(
            network, form, clouds, batch, torch.get_num_threads(), checkout, device=str(device)
        )
        measured = MeasuredNetwork(task)
        training_ms = measured.training_seconds() * 1000 / batch
        rows.append(
            {
                "network": network,
                "form": form.name,
                "points": clouds.points.shape[1],
                "batch": batch,
                "training_ms": training_ms,
                "training_tflops": gflop / training_ms,
                "inference_1_ms": measured.inference_seconds(1) * 1000,
                f"inference_{batch}_ms": measured.inference_seconds(batch) * 1000 / batch,
                "memory_mib": measured.memory_mib(),
            }
        )
    return rows


def measure_kernels(clouds: Clouds, batch: int, device: torch.device) -> list[Result]:
    """Return the times of searches, sampling and maxima, and the rate of the bytes that they read and write."""
    points = torch.from_numpy(clouds.points[:batch]).to(device)
    batch, num_points, _ = points.shape
    centres, k = points[:, : num_points // 8], 20
    features = torch.randn(batch, num_points, _CHANNELS, generator=torch.Generator().manual_seed(0)).to(
        device
    )
    neighbours = knn(points, points, k)
    pairs = batch * num_points * num_points * 4  # bytes of all distances, once
    gathered = neighbours.numel() * _CHANNELS * 4
    steps: dict[str, tuple[Callable[[], object], int]] = {
        "nearest of coordinates": (lambda: knn(points, points, k), pairs),
        "nearest of features": (lambda: knn(features, features, k), pairs),
        "ball query": (lambda: ball_query(centres, points, 0.2, 32), pairs // 8),
        "farthest points": (
            lambda: farthest_points(points, num_points // 4),
            batch * num_points * 16 * (num_points // 4),
        ),
        "gather": (lambda: gather_rows(features, neighbours), 2 * gathered),
        "maximum of neighbours": (
            lambda: neighbour_max(features, neighbours),
            gathered + features.numel() * 4,
        ),
    }
    rows = []
    for name, (step, num_bytes) in steps.items():
        with torch.inference_mode():
            seconds = median_seconds(step, device=str(device))
        rows.append(
            {"kernel": name, "ms_per_cloud": seconds * 1000 / batch, "gb_per_s": num_bytes / seconds / 1e9}
        )
    return rows


def measure_rendering(device: torch.device, quick: bool) -> list[Result]:
    """Return the times of frames that are rendered together (`python -m benchmarks simulation`)."""
    from benchmarks.simulation import measure_batches

    scenes, numbers = (1, [1]) if quick else (64, [1, 8, 64])
    return measure_batches("varied", "xtion", scenes, numbers, str(device), torch.get_num_threads())


def _training_step(network: PointNetwork, points: Tensor, labels: Tensor) -> tuple[dict[str, Tensor], Tensor]:
    """Return loss, logits and running statistics, and all gradients as one vector, on the processor."""
    for module in network.modules():
        if isinstance(module, nn.Dropout):  # devices draw other numbers
            module.p = 0.0
    loss, logits = network.train().training_loss(points, labels)
    loss.backward()  # type: ignore[no-untyped-call]
    grads = [p.grad.flatten() for p in network.parameters() if p.grad is not None]
    outputs = {"loss": loss.detach(), "logits": logits.detach()}
    outputs |= {name: value for name, value in network.named_buffers() if value.is_floating_point()}
    return {name: value.cpu() for name, value in outputs.items()}, torch.cat(grads).cpu()


def _difference(got: Tensor, expected: Tensor) -> float:
    return float((got - expected).norm() / expected.norm().clamp_min(1e-12))
