# SPDX-License-Identifier: Apache-2.0
"""The service over real sockets: answers, every refusal, slow clients, a full queue, and a clean stop."""

from __future__ import annotations

import http.client
import io
import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import uvicorn
from PIL import Image

import doorstate
from doorstate.inference.abstention import Abstention
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.io.pcd import write_pcd
from doorstate.io.readers import CLOUD_SUFFIXES
from doorstate.networks import create_network
from doorstate.networks.weights import WeightsCard, save_weights
from doorstate.serving.app import create_app
from doorstate.serving.models import PredictionResponse
from doorstate.serving.request import PredictQuery
from doorstate.serving.server import KEEP_ALIVE_S, listen
from doorstate.serving.work_queue import Limits

Run = Callable[..., tuple[int, str, str]]
COMMAND = Path(sys.executable).with_name("doorstate")
CAMERA = {"fx": 30, "fy": 30, "cx": 19.5, "cy": 14.5}
NETWORK = create_network("pointnet")
CARD = WeightsCard(network="pointnet", num_points=256)


def bytes_of(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


CLOUD = np.random.default_rng(0).uniform((1, -1, -1), (3, 1, 1), (500, 3)).astype(np.float32)
NPY = bytes_of(CLOUD)


class Stopped:
    """A gate that lets every cloud pass, once it is opened itself; a worker waits at it."""

    def __init__(self) -> None:
        self.opened = threading.Event()
        self.arrived = threading.Semaphore(0)

    def __call__(self, cloud: np.ndarray) -> None:
        self.arrived.release()
        assert self.opened.wait(10)


@contextmanager
def serving(gate: Any = None, rule: str = "", **limits: Any) -> Iterator[httpx.Client]:
    """A client of the service, run by Uvicorn in a thread of this process."""
    answering = (
        RulePredictor.from_name(rule) if rule else NetworkPredictor(TorchBackend(NETWORK, CARD), gate=gate)
    )
    app = create_app(answering, Limits(**{"workers": 1} | limits))
    listening = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(
        app,
        http="h11",
        ws="none",
        log_level="error",
        timeout_keep_alive=KEEP_ALIVE_S,
        timeout_graceful_shutdown=10,
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{listening.getsockname()[1]}", timeout=10) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join()


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    with serving(max_bytes=100_000) as served:
        yield served


def error_of(response: httpx.Response, status: int) -> str:
    """The one line of a refusal."""
    assert response.status_code == status, response.text
    (line,) = response.json().values()
    assert set(response.json()) == {"error"}
    assert "\n" not in line
    return line


def test_the_answer_is_that_of_the_command(client: httpx.Client, run: Run, tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", NETWORK, CARD)
    (tmp_path / "cloud.npy").write_bytes(NPY)
    code, out, err = run("predict", tmp_path / "cloud.npy", "--json", "--weights", tmp_path / "w.safetensors")
    assert code == 0, err
    printed = json.loads(out)
    answer = client.post("/predict", params={"format": "npy"}, content=NPY).raise_for_status().json()
    del printed["file"], printed["milliseconds"]
    assert answer.pop("milliseconds") > 0
    assert answer == printed
    assert list(answer) == list(printed)


def test_a_refused_cloud_has_a_reason_and_no_state() -> None:
    with serving(gate=lambda cloud: Abstention("too_near", {"median_m": 0.2})) as client:
        answer = client.post("/predict?format=npy", content=NPY).raise_for_status().json()
    assert answer["state"] is None
    assert "0.20 m" in answer["reason"]
    always = {"state", "probabilities", "points", "milliseconds", "reason"}
    assert set(answer) == always <= set(PredictionResponse.model_fields)


@pytest.mark.parametrize(
    ("query", "content_type"),
    [
        ("format=npy", "image/png"),
        ("format=.NPY", None),
        ("filename=my.cloud.NPY", "text/csv"),
        ("", "application/x-npy"),
        ("", "application/npy; version=1"),
    ],
)
def test_the_type_is_said_in_one_of_three_ways(
    client: httpx.Client, query: str, content_type: str | None
) -> None:
    headers = {"content-type": content_type} if content_type else {}
    assert client.post(f"/predict?{query}", content=NPY, headers=headers).status_code == 200


def test_every_type_of_file_is_answered_alike(client: httpx.Client, tmp_path: Path) -> None:
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
    assert {f".{kind}" for kind in files} | {".png"} == set(CLOUD_SUFFIXES)
    answers = []
    for kind, content in files.items():
        answer = client.post("/predict", params={"format": kind}, content=content).raise_for_status().json()
        answers.append(answer["probabilities"])
    assert answers == [answers[0]] * len(files)


def test_frame_units_and_camera_mean_what_they_mean_to_the_command(client: httpx.Client) -> None:
    def probabilities(content: bytes, **query: Any) -> dict[str, float]:
        answer = client.post("/predict", params=query, content=content).raise_for_status().json()
        found: dict[str, float] = answer["probabilities"]
        return found

    forward, left, up = CLOUD.T
    optical_mm = (np.stack([-left, -up, forward], axis=1) * 1000).astype(np.float32)
    expected = probabilities(NPY, format="npy")
    found = probabilities(bytes_of(optical_mm), format="npy", frame="optical", units="mm")
    assert found == pytest.approx(expected, abs=1e-3)
    turned = probabilities(bytes_of(np.stack([forward, up, -left], axis=1)), format="npy", roll=90)
    assert turned == pytest.approx(expected, abs=1e-5)
    depth = np.random.default_rng(0).integers(1000, 3000, (30, 40), dtype=np.uint16)
    png = io.BytesIO()
    Image.fromarray(depth).save(png, "PNG")
    millimetres = probabilities(png.getvalue(), format="png", **CAMERA)
    metres = probabilities(bytes_of((depth / 1000).astype(np.float32)), format="npy", **CAMERA)
    assert millimetres == pytest.approx(metres, abs=1e-4)
    fifths = probabilities(bytes_of(depth * np.uint16(5)), format="npy", depth_scale=0.0002, **CAMERA)
    assert fifths == pytest.approx(metres, abs=1e-4)


@pytest.mark.parametrize(
    ("query", "content", "status", "complaint"),
    [
        ("format=pcd", b"nonsense", 400, "is no PCD file"),
        ("format=pcd", b"", 400, r"empty \(0 bytes\)"),
        ("format=npy", NPY[:50], 400, "damaged, or no .npy file"),
        ("format=npy&frame=sideways", NPY, 400, "frame 'sideways' is neither"),
        ("format=npy&roll=45", NPY, 400, "a roll of 45 degrees is not 0, 90, 180 or 270"),
        ("format=npy&roll=left", NPY, 400, "^roll: .*valid integer"),
        ("format=npy&units=furlongs", NPY, 400, "^units furlongs: choose one of m,"),
        ("format=npy&depth_scale=nan", NPY, 400, "a scale of nan metres per unit"),
        ("format=npy&fx=3", NPY, 400, "^fx, fy, cx and cy belong together"),
        ("format=npy&fram=optical", NPY, 400, "no parameter fram: there are format, filename, frame"),
        ("format=npy", bytes_of(np.ones((30, 40), np.uint16)), 400, "camera's intrinsics: give fx fy cx cy$"),
        ("format=stl", NPY, 415, r"say \?format= and one of pcd, ply"),
        ("filename=cloud", NPY, 415, "unknown type"),
        ("", NPY, 415, "unknown type"),
        ("format=npy", bytes_of(CLOUD * np.nan), 422, "all points are NaN"),
        ("format=npy", bytes_of(CLOUD[:0]), 422, "holds no points"),
        ("format=npy", bytes_of(CLOUD * 1000), 422, "1000 times too far .* say units mm"),
        ("format=xyz", b"1 2 3\n" * 20_000, 413, "more than 0.0953674 MB"),
    ],
)
def test_what_cannot_be_answered_is_refused_in_one_line(
    client: httpx.Client, query: str, content: bytes, status: int, complaint: str
) -> None:
    line = error_of(client.post(f"/predict?{query}", content=content), status)
    assert re.search(complaint, line), line


def test_other_places_and_methods(client: httpx.Client) -> None:
    assert "POST a file to /predict" in error_of(client.get("/nowhere"), 404)
    wrong = client.put("/predict?format=npy", content=NPY)
    assert "POST a file to /predict" in error_of(wrong, 405)
    assert wrong.headers["allow"] == "POST"
    assert "/predict" in client.get("/").raise_for_status().text


def test_health_says_what_answers(client: httpx.Client) -> None:
    assert client.get("/health").json() == {
        "ready": True,
        "network": "pointnet",
        "points": 256,
        "version": doorstate.__version__,
    }


def test_a_rule_answers_too() -> None:
    with serving(rule="plane_state") as asking:
        assert asking.get("/health").json() == {
            "ready": True,
            "rule": "plane_state",
            "version": doorstate.__version__,
        }
        answer = asking.post("/predict?format=npy", content=NPY).json()
    assert answer["points"] == len(CLOUD.reshape(-1, 3))


def test_openapi_tells_all(client: httpx.Client) -> None:
    told = client.get("/openapi.json").raise_for_status().json()
    predict = told["paths"]["/predict"]["post"]
    assert {parameter["name"] for parameter in predict["parameters"]} == set(PredictQuery.model_fields)
    assert "application/octet-stream" in predict["requestBody"]["content"]
    assert set(predict["responses"]) == {"200", "400", "413", "415", "422", "503", "504"}
    schemas = told["components"]["schemas"]
    assert set(schemas) == {"Answer", "Health", "Problem"}
    for status, response in predict["responses"].items():
        name = response["content"]["application/json"]["schema"]["$ref"].rpartition("/")[2]
        assert name == ("Answer" if status == "200" else "Problem")
    kinds = next(p for p in predict["parameters"] if p["name"] == "format")["schema"]["enum"]
    assert [f".{kind}" for kind in kinds] == list(CLOUD_SUFFIXES)
    assert client.get("/docs").status_code == 200


def test_a_large_file_is_refused_though_no_length_says_so(client: httpx.Client) -> None:
    response = client.post("/predict?format=npy", content=iter([bytes(50_000)] * 3))
    assert response.request.headers["transfer-encoding"] == "chunked"
    assert "more than" in error_of(response, 413)
    assert client.post("/predict?format=npy", content=iter([NPY[:100], NPY[100:]])).status_code == 200


def raw_request(client: httpx.Client, head: str) -> socket.socket:
    """A connection that has sent the head of a request and no more."""
    connection = socket.create_connection((client.base_url.host, client.base_url.port or 0), timeout=10)
    connection.sendall(f"{head}\r\nHost: here\r\n\r\n".encode())
    return connection


def status_of(connection: socket.socket) -> int:
    return int(connection.recv(65536).split()[1])


def test_the_refusal_of_a_large_file_is_there_before_the_client_is_done(client: httpx.Client) -> None:
    head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000000000"
    with raw_request(client, head) as connection:
        assert status_of(connection) == 413
    with raw_request(client, "POST /predict?format=npy HTTP/1.1\r\nTransfer-Encoding: chunked") as connection:
        for _ in range(3):
            connection.sendall(b"C350\r\n" + bytes(50_000) + b"\r\n")
        assert status_of(connection) == 413
        connection.sendall(
            b"C350\r\n" + bytes(50_000) + b"\r\n"
        )  # still read, so that no reset hides the answer
        started = time.monotonic()
        while connection.recv(65536):
            pass
        assert time.monotonic() - started < 5, "the connection is closed soon"


def test_slow_clients_are_told_so_and_keep_nobody_waiting() -> None:
    with serving(timeout_s=0.7, queue=0) as client:
        head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000"
        slow = [raw_request(client, head) for _ in range(5)]
        for connection in slow:
            connection.sendall(NPY[:10])
        assert client.post("/predict?format=npy", content=NPY).status_code == 200, (
            "one worker, five slow clients"
        )
        assert [status_of(connection) for connection in slow] == [504] * 5
        for connection in slow:
            connection.close()


def test_a_client_that_goes_away_does_no_harm() -> None:
    with serving(queue=0) as client:
        for _ in range(3):
            raw_request(client, "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000").close()
        assert client.post("/predict?format=npy", content=NPY).status_code == 200


def test_a_full_queue_and_a_slow_worker() -> None:
    gate = Stopped()
    with serving(gate, queue=1, timeout_s=1.0) as client, ThreadPoolExecutor(3) as threads:
        in_work = threads.submit(client.post, "/predict?format=npy", content=NPY)
        assert gate.arrived.acquire(timeout=5)
        others = [threads.submit(client.post, "/predict?format=npy", content=NPY) for _ in range(2)]
        refused = next(as_completed(others)).result()
        assert error_of(refused, 503) == "too many files are waiting: try again"
        assert refused.headers["retry-after"] == "1"
        assert client.get("/health").status_code == 200, "the event loop is free"
        waited = next(other.result() for other in others if other.result() is not refused)
        for late in (in_work.result(), waited):
            assert error_of(late, 504) == "there was no answer after 1 s"
        gate.opened.set()
        deadline = time.monotonic() + 5
        while (answered := client.post("/predict?format=npy", content=NPY)).status_code == 503:
            assert time.monotonic() < deadline
        assert answered.status_code == 200, "places come back"


def test_bytes_that_are_still_coming_are_bounded() -> None:
    with serving(max_bytes=10_000, queue=1) as client:
        head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 9000"
        slow = [raw_request(client, head) for _ in range(3)]
        for connection in slow:  # 3 x 8 kB are more than two files of 10 kB
            connection.sendall(bytes(8000))
        deadline = time.monotonic() + 5
        while client.post("/predict?format=npy", content=NPY).status_code == 200:
            assert time.monotonic() < deadline
        for connection in slow:
            connection.close()
        while client.post("/predict?format=npy", content=NPY).status_code == 503:
            assert time.monotonic() < deadline + 5


def test_many_clients_get_their_own_answers(client: httpx.Client) -> None:
    files = [bytes_of(CLOUD * np.float32(scale)) for scale in (1.0, 1.5, 2.0)]

    def probabilities(file: bytes) -> dict[str, float]:
        found: dict[str, float] = client.post("/predict?format=npy", content=file).json()["probabilities"]
        return found

    alone = [probabilities(file) for file in files]
    assert len({tuple(each.values()) for each in alone}) == 3
    with ThreadPoolExecutor(6) as threads:
        assert list(threads.map(probabilities, files * 4)) == alone * 4


def test_the_command_listens_answers_and_stops_cleanly(tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", NETWORK, CARD)
    process = subprocess.Popen(
        [COMMAND, "serve", "--port", "0", "--weights", tmp_path / "w.safetensors", "--workers", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        address = line.split()[3]
        assert line.startswith("doorstate: listening on http://127.0.0.1:")
        assert httpx.get(f"{address}/health").json()["ready"] is True
        assert httpx.post(f"{address}/predict?format=npy", content=NPY).status_code == 200
        # An idle connection outlives the five seconds for which httpx would use it again, and Uvicorn by itself.
        kept = http.client.HTTPConnection(address.removeprefix("http://"), timeout=10)
        for idle_s in (0.0, 5.5):
            time.sleep(idle_s)
            kept.request("GET", "/health")
            assert json.load(kept.getresponse())["ready"] is True
        kept.close()
    finally:
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=10)
    assert (process.returncode, out, err) == (0, "", "")


def test_no_part_of_an_answer_waits_for_the_one_before() -> None:
    with listen("127.0.0.1", 0) as listening, socket.create_connection(listening.getsockname()):
        accepted, _ = listening.accept()
        with accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_a_port_that_is_taken_is_one_line(run: Run, tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", NETWORK, CARD)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, _, err = run("serve", "--port", port, "--weights", tmp_path / "w.safetensors")
    assert code == 1
    assert err == f"doorstate: cannot listen on 127.0.0.1, port {port}: Address already in use\n"


def test_without_its_packages_they_are_named(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    code, _, err = run("serve")
    assert code == 1
    assert err == "doorstate: serve needs what is not installed: pip install fastapi uvicorn\n"


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not here")
def test_the_requests_in_the_docs_are_answered(client: httpx.Client, tmp_path: Path) -> None:
    write_pcd(tmp_path / "cloud.pcd", CLOUD)
    (tmp_path / "cloud.npy").write_bytes(NPY)
    Image.fromarray(np.full((480, 640), 2000, np.uint16)).save(tmp_path / "depth.png")
    text = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text(encoding="utf-8")
    commands = re.findall("^curl .*", text, flags=re.MULTILINE)
    assert len(commands) == 4
    for command in commands:
        here = shlex.split(command.replace("http://127.0.0.1:8000", str(client.base_url)))
        answer = json.loads(subprocess.check_output([*here, "--silent"], cwd=tmp_path))
        assert answer.get("state") is not None or answer.get("ready"), command
