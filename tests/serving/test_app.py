# SPDX-License-Identifier: Apache-2.0
"""Service over real sockets: predictions, errors, health and description."""

from __future__ import annotations

import io
import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image

import doorstate
from doorstate.inference.predictor import Predictor
from doorstate.io.formats import CLOUD_SUFFIXES
from doorstate.io.pcd import write_pcd
from doorstate.io.sensor_pose import camera_pose
from doorstate.serving.errors import STATUS_DESCRIPTIONS
from doorstate.serving.models import PredictionResponse
from doorstate.serving.request import PredictQuery
from tests.serving.helpers import CLOUD, NPY, error_of, npy_bytes, serving

Run = Callable[..., tuple[int, str, str]]
CAMERA = {"fx": 30, "fy": 30, "cx": 19.5, "cy": 14.5}


def test_prediction_equals_that_of_the_command(run: Run, tmp_path: Path) -> None:
    (tmp_path / "cloud.npy").write_bytes(NPY)
    code, out, err = run("predict", tmp_path / "cloud.npy", "--json", "--rule", "plane_state")
    assert code == 0, err
    printed = json.loads(out)
    with serving(partial(Predictor.load, rule="plane_state")) as client:
        assert client.get("/health").json() == {
            "ready": True,
            "rule": "plane_state",
            "version": doorstate.__version__,
        }
        response = client.post("/predict?format=npy", content=NPY).raise_for_status().json()
    del printed["file"], printed["method"], printed["milliseconds"]
    assert response.pop("milliseconds") > 0
    assert response == printed
    assert list(response) == list(printed), "the order of the fields"
    assert set(response) <= set(PredictionResponse.model_fields)


@pytest.mark.parametrize(
    ("query", "content_type"),
    [
        ("format=npy", "image/png"),
        ("format=.NPY", None),
        ("filename=my.cloud.NPY", "text/csv"),
        ("filename=cloud.npy.gz", None),
        ("filename=cloud", None),
        ("", "application/octet-stream"),
        ("", "application/x-npy"),
        ("", "application/npy; version=1"),
    ],
)
def test_format_is_given_by_the_request_or_by_the_first_bytes(
    client: httpx.Client, query: str, content_type: str | None
) -> None:
    headers = {"content-type": content_type} if content_type else {}
    assert client.post(f"/predict?{query}", content=NPY, headers=headers).status_code == 200


def test_all_formats_give_the_same_prediction(client: httpx.Client, tmp_path: Path) -> None:
    write_pcd(tmp_path / "cloud.pcd", CLOUD)
    rows = "\n".join(" ".join(map(str, row)) for row in CLOUD.tolist())
    packed = io.BytesIO()
    np.savez_compressed(packed, cloud=CLOUD)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(CLOUD)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    files = {
        "pcd": (tmp_path / "cloud.pcd").read_bytes(),
        "ply": header.encode() + CLOUD.tobytes(),
        "npy": NPY,
        "npz": packed.getvalue(),
        "xyz": rows.encode(),
        "txt": rows.encode(),
        "csv": b"x,y,z\n" + rows.replace(" ", ",").encode(),
    }
    assert {f".{name}" for name in files} | {".png"} == set(CLOUD_SUFFIXES)
    probabilities = []
    for name, content in files.items():
        response = client.post("/predict", params={"format": name}, content=content).raise_for_status()
        probabilities.append(response.json()["probabilities"])
    assert probabilities == [probabilities[0]] * len(files)


def test_frame_roll_units_and_camera_transform_the_cloud(client: httpx.Client) -> None:
    def probabilities(content: bytes, **query: Any) -> dict[str, float]:
        response = client.post("/predict", params=query, content=content).raise_for_status().json()
        result: dict[str, float] = response["probabilities"]
        return result

    forward, left, up = CLOUD.T
    optical_mm = (np.stack([-left, -up, forward], axis=1) * 1000).astype(np.float32)
    expected = probabilities(NPY, format="npy")
    optical = probabilities(npy_bytes(optical_mm), format="npy", axes="optical", units="mm")
    assert optical == pytest.approx(expected, abs=1e-3)
    turned = probabilities(npy_bytes(np.stack([forward, up, -left], axis=1)), format="npy", roll=90)
    assert turned == pytest.approx(expected, abs=1e-5)
    down = npy_bytes(camera_pose("ros", pitch_deg=-20).to_body(CLOUD))
    tilted = [{"pitch": 20}, {"quaternion": "0,0.17364818,0,0.98480775"}]
    for query in tilted:
        assert probabilities(down, format="npy", **query) == pytest.approx(expected, abs=1e-3)
    depth = np.random.default_rng(0).integers(1000, 3000, (30, 40), dtype=np.uint16)
    png = io.BytesIO()
    Image.fromarray(depth).save(png, "PNG")
    millimetres = probabilities(png.getvalue(), format="png", **CAMERA)
    metres = probabilities(npy_bytes((depth / 1000).astype(np.float32)), format="npy", **CAMERA)
    assert millimetres == pytest.approx(metres, abs=1e-4)
    fifths = probabilities(npy_bytes(depth * np.uint16(5)), format="npy", depth_scale=0.0002, **CAMERA)
    assert fifths == pytest.approx(metres, abs=1e-4)


@pytest.mark.parametrize(
    ("query", "content", "status", "name"),
    [
        ("format=pcd", b"nonsense", 400, ""),
        ("format=pcd", b"", 400, ""),
        ("format=npy", NPY[:50], 400, ""),
        ("format=npy&axes=sideways", NPY, 400, "axes"),
        ("format=npy&roll=450", NPY, 400, "roll"),
        ("format=npy&roll=left", NPY, 400, "roll"),
        ("format=npy&camera_height=-1", NPY, 400, "camera_height"),
        ("format=npy&units=furlongs", NPY, 400, "units"),
        ("format=npy&depth_scale=nan", NPY, 400, "nan"),
        ("format=npy&fx=3", NPY, 400, "fy"),
        ("format=npy&axis=optical", NPY, 400, "axes"),
        ("format=npy", npy_bytes(np.ones((30, 40), np.uint16)), 400, "fx"),
        ("format=stl", NPY, 415, "pcd"),
        ("filename=cloud.stl", NPY, 415, "pcd"),
        ("", b"1 2 3\n", 415, "pcd"),
        ("format=npy", npy_bytes(CLOUD * np.nan), 422, ""),
        ("format=npy", npy_bytes(CLOUD[:0]), 422, ""),
        ("format=npy", npy_bytes(CLOUD * 1000), 422, "units=mm"),
        ("format=xyz", b"1 2 3\n" * 20_000, 413, ""),
    ],
)
def test_unusable_requests_are_one_line(
    client: httpx.Client, query: str, content: bytes, status: int, name: str
) -> None:
    error = error_of(client.post(f"/predict?{query}", content=content), status)
    assert name in error
    assert "--" not in error, "flags are those of the command line"


def test_unknown_paths_and_methods(client: httpx.Client) -> None:
    assert "/predict" in error_of(client.get("/nowhere"), 404)
    response = client.put("/predict?format=npy", content=NPY)
    assert "/predict" in error_of(response, 405)
    assert response.headers["allow"] == "POST"
    assert "/predict" in client.get("/").raise_for_status().text


def test_health_names_the_network() -> None:
    with serving(partial(Predictor.load, num_points=256)) as client:
        assert client.get("/health").json() == {
            "ready": True,
            "network": "pointnet2",
            "points": 256,
            "version": doorstate.__version__,
        }


def test_openapi_describes_the_interface(client: httpx.Client) -> None:
    description = client.get("/openapi.json").raise_for_status().json()
    predict = description["paths"]["/predict"]["post"]
    assert {parameter["name"] for parameter in predict["parameters"]} == set(PredictQuery.model_fields)
    assert "application/octet-stream" in predict["requestBody"]["content"]
    assert set(predict["responses"]) == {"200", *map(str, STATUS_DESCRIPTIONS)}
    schemas = description["components"]["schemas"]
    names = ("Prediction", "Door", "Tilt", "SensorPose", "Health", "Error")
    assert set(schemas) == {f"{name}Response" for name in names}
    for status, response in predict["responses"].items():
        name = response["content"]["application/json"]["schema"]["$ref"].rpartition("/")[2]
        assert name == ("PredictionResponse" if status == "200" else "ErrorResponse")
    formats = next(p for p in predict["parameters"] if p["name"] == "format")["schema"]["enum"]
    assert [f".{name}" for name in formats] == list(CLOUD_SUFFIXES)
    page = client.get("/docs").raise_for_status()
    assert all(name in page.text for name in (*PredictQuery.model_fields, *PredictionResponse.model_fields))
    assert not re.search(r"<script|src=|https?://", page.text)
    assert "default-src 'none'" in page.headers["content-security-policy"]


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_requests_in_the_docs_succeed(client: httpx.Client, tmp_path: Path) -> None:
    write_pcd(tmp_path / "cloud.pcd", CLOUD)
    (tmp_path / "cloud.npy").write_bytes(NPY)
    Image.fromarray(np.full((480, 640), 2000, np.uint16)).save(tmp_path / "depth.png")
    text = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text(encoding="utf-8")
    commands = re.findall(r"^curl .*127\.0\.0\.1.*", text, flags=re.MULTILINE)
    assert len(commands) == 4
    for command in commands:
        arguments = shlex.split(command.replace("http://127.0.0.1:8000", str(client.base_url)))
        response = json.loads(subprocess.check_output([*arguments, "--silent"], cwd=tmp_path))
        assert response.get("state") is not None or response.get("ready"), command
