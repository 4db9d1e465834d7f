# SPDX-License-Identifier: Apache-2.0
"""Time of a simulated frame from the first random number to its crops on disk, by stage, and of batched rendering."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import torch

from benchmarks.store import Result
from benchmarks.timing import format_ms, median_seconds, peak_resident_mib, reset_peak, timed_calls
from doorstate._jobs import Progress
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset import crops, pieces, sampling, simulated
from doorstate.dataset.crops import Crops
from doorstate.dataset.preparation import Preparation
from doorstate.evaluation.table import Table
from doorstate.simulation import frames, generate, writer
from doorstate.simulation.batched_render import BoxBatch, place_batch, render_batch
from doorstate.simulation.presets import draw_rows
from doorstate.simulation.settings import settings_for
from doorstate.training.run import torch_threads

_STAGES: dict[str, tuple[object, str]] = {
    "draw": (generate, "draw_rows"),
    "render": (frames, "render_states"),
    "sense": (frames, "sense"),
    "outliers": (crops, "remove_outliers"),
    "find": (crops, "find_doorways"),
    "crops": (sampling, "crop_cloud"),
    "save": (pieces.PieceClouds, "save"),
    "rows": (writer, "write_csv"),
    "join": (simulated, "assemble"),
}
STAGES = (*_STAGES, "other", "total", "processor")
_NOTE = (
    "Milliseconds of a frame in one process, mean: *draw* a scene, *render* it (what its states share once), "
    "*sense*, remove *outliers*, *find* doorways, cut and sample *crops*, *save* them, write *rows* of the manifest, "
    "*join* all pieces. *Processor* is the time of all threads together, *bytes* are those of a crop on disk with its "
    "line of the manifest, *memory* is the peak of the process in MiB."
)


def measure_simulation(
    combinations: Sequence[tuple[str, str]], scenes: int, num_points: int, progress: Progress
) -> list[Result]:
    """Return the times of the stages for presets with sensors.

    Args:
        combinations: preset and sensor of each row.
        scenes: scenes to simulate for each.
        num_points: points of a crop.
        progress: called with combinations measured and combinations in all.
    """
    rows: list[Result] = []
    for number, (preset, sensor) in enumerate(combinations):
        progress(number, len(combinations))
        _simulate(preset, sensor, 2, num_points)  # imports and caches
        rows.append({"preset": preset, "sensor": sensor} | _simulate(preset, sensor, scenes, num_points))
    progress(len(combinations), len(combinations))
    return rows


def measure_batches(
    preset: str, sensor: str, scenes: int, batches: Sequence[int], device: str, threads: int
) -> list[Result]:
    """Return the times of batched rendering.

    Args:
        preset: preset of the scenes.
        sensor: its camera is used.
        scenes: scenes to draw.
        batches: frames that are rendered together.
        device: device of torch.
        threads: threads of torch.
    """
    settings = settings_for(preset, 0, scenes=scenes, sensor=sensor)
    drawn = [draw_rows(settings.preset, 0, index) for index in settings.indices()]
    rows = [generate.with_sensor(row, sensor) for of_pose in drawn for row in of_pose]
    intrinsics = rows[0].camera.intrinsics()
    results: list[Result] = []
    with torch_threads(threads):
        for batch in batches:
            chosen = (rows * (1 + batch // len(rows)))[:batch]
            scenes_boxes, poses = [row.boxes() for row in chosen], [row.camera_pose() for row in chosen]
            place_s = median_seconds(partial(place_batch, scenes_boxes, poses, device))
            boxes = place_batch(scenes_boxes, poses, device)

            def render(boxes: BoxBatch = boxes) -> None:
                render_batch(boxes, intrinsics)
                if torch.device(device).type == "cuda":
                    torch.cuda.synchronize()

            render_s = median_seconds(render)
            speed = {"place_ms": place_s / batch * 1000, "render_ms": render_s / batch * 1000}
            results.append({"batch": batch, **speed, "frames_per_s": batch / (place_s + render_s)})
    return results


def simulation_table(rows: Sequence[Result]) -> Table:
    """Return one row per preset."""
    cells = tuple(
        (
            row["preset"],
            row["sensor"],
            str(row["frames"]),
            str(row["crops"]),
            *(format_ms(row["stages_ms"][stage]) for stage in STAGES),
            f"{row['crops_per_s']:.0f}",
            f"{row['bytes_per_crop']:,.0f}",
            f"{row['memory_mib']:.0f}",
        )
        for row in rows
    )
    columns = ("preset", "sensor", "frames", "crops", *STAGES, "crops/s", "bytes", "memory")
    return Table("From a seed to crops on disk", columns, cells, _NOTE, text_columns=2)


def batches_table(rows: Sequence[Result], device: str) -> Table:
    """Return one row per number of frames."""
    cells = tuple(
        (
            str(row["batch"]),
            format_ms(row["place_ms"]),
            format_ms(row["render_ms"]),
            f"{row['frames_per_s']:.0f}",
        )
        for row in rows
    )
    note = (
        "Milliseconds of a frame: its boxes are placed by NumPy and sent to the device, and rendered by torch on "
        f"{device}, with parts and incidence. The camera is that of the sensor, without its noise."
    )
    return Table("Frames rendered together", ("frames", "place", "render", "frames/s"), cells, note)


def _simulate(preset: str, sensor: str, scenes: int, num_points: int) -> Result:
    """Return the mean times of one simulation in this process, its numbers of frames and crops, and its size."""
    settings = settings_for(preset, 0, scenes=scenes, sensor=sensor)
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        source, prepared = Path(folder, "simulated"), Path(folder, "prepared")
        spec = CloudSpec(num_points=num_points)
        preparation = Preparation(source, spec, crops=Crops(add_missed=True))
        stages = {name: stack.enter_context(timed_calls(*owner)) for name, owner in _STAGES.items()}
        reset_peak()
        started, started_processor = time.perf_counter(), time.process_time()
        summary = simulated.simulate_prepared(settings, preparation, prepared, workers=1)
        total_s = time.perf_counter() - started
        processor_ms = (time.process_time() - started_processor) * 1000
        memory_mib = peak_resident_mib()
        size = sum(path.stat().st_size for path in prepared.rglob("*") if path.is_file())
        num_frames = len(stages["sense"])
        num_crops = len(summary.dataset)
    stages_ms = {name: sum(durations_ms) / num_frames for name, durations_ms in stages.items()}
    total_ms = total_s * 1000 / num_frames
    return {
        "frames": num_frames,
        "crops": num_crops,
        "stages_ms": stages_ms
        | {"other": total_ms - sum(stages_ms.values()), "total": total_ms}
        | {"processor": processor_ms / num_frames},
        "crops_per_s": num_crops / total_s,
        "bytes_per_crop": size / max(num_crops, 1),
        "memory_mib": memory_mib,
    }
