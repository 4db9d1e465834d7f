# SPDX-License-Identifier: Apache-2.0
"""Files with other inputs or outputs than an exported network are refused, at load or where they are run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import ModelProto, TensorProto, helper, numpy_helper

from doorstate.clouds.preparation import MIN_POINTS
from doorstate.errors import WeightsError
from doorstate.inference.backends.onnx_backend import OnnxBackend
from tests.attack.numbers import write_graph

POINTS = np.ones((2, MIN_POINTS, 3), np.float32)
Edit = Callable[[ModelProto], None]


def renamed(model: ModelProto) -> None:
    model.graph.input[0].name = model.graph.node[0].input[0] = "x"


def more_inputs(model: ModelProto) -> None:
    model.graph.input.append(helper.make_tensor_value_info("more", TensorProto.FLOAT, [1]))


def takes(kind: int, *shape: int | str) -> Edit:
    def edit(model: ModelProto) -> None:
        model.graph.input[0].CopyFrom(helper.make_tensor_value_info("points", kind, shape))
        model.graph.node.insert(0, helper.make_node("Cast", ["points"], ["cast"], to=TensorProto.FLOAT))
        model.graph.node[1].input[0] = "cast"

    return edit


def gives(name: str, value: Any, dtype: type[np.generic]) -> Edit:
    def edit(model: ModelProto) -> None:
        array = np.array(value, dtype)
        changes = {f"{name}.value": array, f"{name}.width": np.array(array.shape, np.int64)}
        for constant in model.graph.initializer:
            if constant.name in changes:
                constant.CopyFrom(numpy_helper.from_array(changes[constant.name], constant.name))
        kind = helper.np_dtype_to_tensor_dtype(array.dtype)
        for output in model.graph.output:
            if output.name == name:
                output.CopyFrom(helper.make_tensor_value_info(name, kind, None))

    return edit


def without(name: str) -> Edit:
    def edit(model: ModelProto) -> None:
        kept = [output for output in model.graph.output if output.name != name]
        del model.graph.output[:]
        model.graph.output.extend(kept)

    return edit


def edited(path: Path, edit: Edit) -> Path:
    write_graph(path, (0.1, 0.1, 0.8), 0.9)
    model = onnx.load(path)
    edit(model)
    card = next(entry for entry in model.metadata_props if entry.key == "doorstate")
    card.value = card.value.replace("digest", "trained_on", 1)  # a file without a digest
    onnx.save(model, path)
    return path


@pytest.mark.parametrize(
    ("edit", "field"),
    [
        (renamed, "points"),
        (more_inputs, "points"),
        (takes(TensorProto.DOUBLE, "batch", MIN_POINTS, 3), "points"),
        (takes(TensorProto.FLOAT, 2, MIN_POINTS, 3), "points"),
        (takes(TensorProto.FLOAT, "batch", 64, 3), "points"),
        (takes(TensorProto.FLOAT, "batch", MIN_POINTS, 4), "points"),
        (takes(TensorProto.FLOAT, "batch", MIN_POINTS, 3, 1), "points"),
        (gives("raw_probabilities", [0.2, 0.8], np.float32), "raw_probabilities"),
        (gives("raw_probabilities", np.full((3, 3), 0.2), np.float32), "raw_probabilities"),
        (gives("raw_probabilities", [0, 0, 1], np.int64), "raw_probabilities"),
        (gives("raw_probabilities", [0.1, 0.1, 0.8], np.float64), "raw_probabilities"),
        (gives("door", 0.9, np.float32), "door"),
        (gives("door", [0.9, 0.9], np.float32), "door"),
        (gives("reason", np.nan, np.float32), "reason"),
        (without("raw_probabilities"), "raw_probabilities"),
        (without("door"), "door"),
        (without("reason"), "probabilities"),
    ],
)
def test_other_inputs_and_outputs_are_refused(edit: Edit, field: str, tmp_path: Path) -> None:
    path = edited(tmp_path / "door.onnx", edit)
    with pytest.raises(WeightsError) as caught:
        OnnxBackend(path)(POINTS)
    assert (caught.value.path, caught.value.field) == (path, field)
    assert "\n" not in str(caught.value)


def test_a_graph_that_fails_is_a_weights_error(tmp_path: Path) -> None:
    def broken(model: ModelProto) -> None:
        constant = next(constant for constant in model.graph.initializer if constant.name == "axes")
        constant.CopyFrom(numpy_helper.from_array(np.array([7], np.int64), "axes"))
        model.graph.initializer.append(numpy_helper.from_array(np.array([0], np.int64), "zero"))
        model.graph.node.insert(0, helper.make_node("Add", ["axes", "zero"], ["far"]))
        model.graph.node[1].input[1] = "far"

    path = edited(tmp_path / "door.onnx", broken)
    with pytest.raises(WeightsError) as caught:
        OnnxBackend(path)(POINTS)
    assert caught.value.path == path


def test_an_unchanged_file_is_read(tmp_path: Path) -> None:
    outputs = OnnxBackend(edited(tmp_path / "door.onnx", lambda model: None))(POINTS)
    np.testing.assert_allclose(outputs.heads["p_door"], [0.9, 0.9], rtol=1e-6)
