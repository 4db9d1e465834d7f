# SPDX-License-Identifier: Apache-2.0
"""ONNX graph that takes its tensors from the weights file beside it, for any number of points.

So weights are stored once, for torch and for onnxruntime. The graph declares its tensors as ONNX's external
data in the file, and begins by making float32 of float16.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from doorstate._files import atomic_path
from doorstate.errors import ExportError, summarize_exception
from doorstate.inference.backends.onnx_backend import TENSOR_PREFIX, is_in_graph
from doorstate.inference.export.graph import fold_constants, trace
from doorstate.inference.export.packages import OPSET, check_export_packages, without_warnings
from doorstate.networks.tensor_file import TensorPlace, read_header
from doorstate.networks.weights import load_weights

if TYPE_CHECKING:
    from onnx import ModelProto, TensorProto

_NETWORK = "network."  # prefix of the network's tensors where torch traces them


def write_weights_graph(weights: Path) -> Path:
    """Write the graph of a weights file beside it, and return its path.

    Raises:
        MissingExtraError: the packages for an export are not installed.
        WeightsError: the weights cannot be used.
        ExportError: the network cannot be exported.
    """
    path = weights.with_suffix(".onnx")
    with atomic_path(path) as temporary:
        temporary.write_bytes(weights_graph(weights).SerializeToString(deterministic=True))
    return path


def weights_graph(weights: Path) -> ModelProto:
    """Return the graph of a weights file; errors as `write_weights_graph`."""
    check_export_packages()
    network, card = load_weights(weights)
    try:
        with without_warnings():
            model = trace(network, card, None, OPSET)
            _make_inputs(model, _NETWORK)
            model = fold_constants(model)
    except Exception as error:  # the exporter raises errors of any type
        raise ExportError(f"{card.network} cannot be exported: {summarize_exception(error)}") from error
    _read_from(model, weights)
    _remove_traces(model)
    model.producer_name, model.producer_version = "doorstate", ""  # a new version does not change the graph
    return model


def _make_inputs(model: ModelProto, prefix: str) -> None:
    """Turn the tensors of the network into inputs, so that nothing computed from them is stored in the graph."""
    from onnx import helper

    graph = model.graph
    for tensor in [tensor for tensor in graph.initializer if tensor.name.startswith(prefix)]:
        graph.input.append(helper.make_tensor_value_info(tensor.name, tensor.data_type, tensor.dims))
        graph.initializer.remove(tensor)


def _read_from(model: ModelProto, weights: Path) -> None:
    """Replace the inputs of tensors by initializers in a weights file."""
    from onnx import TensorProto, helper

    graph = model.graph
    places = {name: place for name, place in read_header(weights).tensors.items() if is_in_graph(name)}
    graph.initializer.extend(
        _external(TENSOR_PREFIX + name, place, weights.name) for name, place in places.items()
    )
    tensors = [value for value in graph.input if value.name.startswith(_NETWORK)]
    casts = [
        helper.make_node(
            "Cast",
            [TENSOR_PREFIX + value.name.removeprefix(_NETWORK)],
            [value.name],
            name=f"float_{value.name}",
            to=TensorProto.FLOAT,
        )
        for value in tensors
    ]
    for value in tensors:
        graph.input.remove(value)
    nodes = list(graph.node)
    del graph.node[:]
    graph.node.extend([*casts, *nodes])


def _external(name: str, place: TensorPlace, file: str) -> TensorProto:
    from onnx import TensorProto, helper

    tensor = TensorProto(
        name=name,
        dims=place.shape,
        data_type=helper.np_dtype_to_tensor_dtype(place.dtype),
        data_location=TensorProto.EXTERNAL,
    )
    for key, value in (("location", file), ("offset", place.offset), ("length", place.size)):
        tensor.external_data.add(key=key, value=str(value))
    return tensor


def _remove_traces(model: ModelProto) -> None:
    """Remove what the exporter notes about the program that it read: lines of code and inferred shapes."""
    del model.graph.value_info[:]
    del model.graph.metadata_props[:]
    for node in model.graph.node:
        node.doc_string = ""
        del node.metadata_props[:]
    for value in (*model.graph.input, *model.graph.output):
        del value.metadata_props[:]
