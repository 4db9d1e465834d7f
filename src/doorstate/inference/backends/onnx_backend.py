# SPDX-License-Identifier: Apache-2.0
"""Packaged or exported network run by onnxruntime; torch is not needed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate._onnxruntime import open_session
from doorstate.errors import WeightsError, summarize_exception
from doorstate.inference.abstention import AbstentionCode
from doorstate.inference.backends.base import Outputs
from doorstate.inference.backends.onnx_interface import Interface, TensorSpec
from doorstate.inference.backends.threads import default_threads
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.card_file import read_card
from doorstate.networks.heads import HEADS, POINT_HEADS, head_columns
from doorstate.networks.tensor_file import read_tensors, read_weights_file
from doorstate.types import PARTS, STATES, Points

INPUT, REASON = "points", "reason"
PROBABILITIES, RAW_PROBABILITIES = "probabilities", "raw_probabilities"
"""Outputs: probabilities, zero where the state is refused, and those that the network computed in any case."""
REASONS: tuple[AbstentionCode | None, ...] = (
    None,
    "unusable_cloud",  # a point is not finite, (0, 0, 0), or beyond the range or the box of the training clouds
    "points_behind_camera",
    "too_near",
    "too_far",
    "too_small",
    "narrow_view",
    "invalid_outputs",
    "no_door",
    "unsure",
)
"""Reasons by their number in the output `reason`; the first that holds is given."""
TENSOR_PREFIX = "weights."  # of names of tensors that a graph takes from a weights file
_LOG_FATAL_ONLY = 4  # errors are raised as well
# Parts of onnxruntime's messages about files that are newer than itself.
_NEWER = ("Unsupported model IR version", "is under development and support for this is limited")


class OnnxBackend:
    """Network in an `.onnx` file; its graph includes normalisation and temperature.

    Args:
        path: file written by `export_onnx`.
        threads: processor threads of one call; None: `default_threads()`.
        weights: file with the card and the tensors of a graph without them (`write_weights_graph`), which takes any
            number of points.
        spinning: let threads that wait for work keep their processors. On processors that nothing else uses, a call is
            a little quicker; on busy ones it takes several times as long, since waiting threads take time from working
            ones (docs/benchmarks/busy.md).

    Raises:
        WeightsError: the file is missing, damaged, or not written by `export_onnx`.
    """

    network = None

    def __init__(
        self, path: Path, threads: int | None = None, *, weights: Path | None = None, spinning: bool = False
    ) -> None:
        self._session = _open_session(path, threads or default_threads(), weights, spinning)
        if weights is None:
            self.card = _read_card(path, self._session)
            self.num_points: int | None = self.card.num_points
        else:
            self.card, self.num_points = read_card(weights), None
        _check_heads(self.card, weights or path)
        # Packaged graphs, and files of doorstate 0.1, refuse nothing.
        self._refuses = REASON in {output.name for output in self._session.get_outputs()}
        self._heads = head_names(self.card)
        self._interface = Interface(path, INPUT, self.num_points, self._outputs())
        self._interface.check(self._session)

    def __call__(self, points: Points) -> Outputs:
        """Run the network on (B, n, 3) metres in farthest-point order, n as in `num_points`."""
        outputs = self._interface.run(self._session, points)
        probabilities = outputs[RAW_PROBABILITIES if self._refuses else PROBABILITIES]
        values = {name: outputs[name] for name in self._heads}
        columns = head_columns(values, self.card.normalization.placement(points))
        return Outputs(probabilities, columns, self._withheld(outputs[REASON]) if self._refuses else None)

    def _outputs(self) -> dict[str, TensorSpec]:
        """Return the outputs to read by name."""
        probabilities = RAW_PROBABILITIES if self._refuses else PROBABILITIES
        specs = {probabilities: TensorSpec("float32", (len(STATES),))}
        specs |= {name: TensorSpec("float32", (len(HEADS[name].columns),)) for name in self._heads}
        return specs | ({REASON: TensorSpec("int64", ())} if self._refuses else {})

    @staticmethod
    def _withheld(reasons: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return (B,) True where heads are not given; those of invalid outputs are, so that they are noticed."""
        withheld: NDArray[np.bool_] = (reasons != 0) & (reasons != REASONS.index("invalid_outputs"))
        return withheld


def head_names(card: WeightsCard) -> tuple[str, ...]:
    """Return the outputs of a file for heads: those of whole clouds."""
    return tuple(name for name in card.heads if name != PARTS)


def _check_heads(card: WeightsCard, path: Path) -> None:
    """Raise WeightsError if a card names a head that does not exist."""
    known = (*HEADS, *POINT_HEADS)
    for name in card.heads:
        if name not in known:
            message = f"has an unknown head {name!r}"
            raise WeightsError(message, path=path, field="heads", expected=" or ".join(known))


def is_in_graph(name: str) -> bool:
    """Return True for tensors of a weights file that a graph for whole clouds takes, from its name."""
    of_point_head = name.startswith(tuple(f"heads.{head}." for head in POINT_HEADS))
    return not of_point_head and not name.endswith(".num_batches_tracked")


def _open_session(path: Path, threads: int, weights: Path | None, spinning: bool) -> Any:
    import onnxruntime  # takes a tenth of a second

    content = read_weights_file(path)
    options = onnxruntime.SessionOptions()
    options.log_severity_level = _LOG_FATAL_ONLY
    options.intra_op_num_threads = threads
    options.add_session_config_entry("session.intra_op.allow_spinning", str(int(spinning)))
    if weights is not None:
        # By value: onnxruntime would refuse a file that an installer has linked from elsewhere.
        tensors = {
            TENSOR_PREFIX + name: onnxruntime.OrtValue.ortvalue_from_numpy(tensor)
            for name, tensor in read_tensors(weights).items()
            if is_in_graph(name)
        }
        options.add_external_initializers(list(tensors), list(tensors.values()))
    try:
        return open_session(content, options)
    except Exception as error:
        if any(word in str(error) for word in _NEWER):
            raise WeightsError(
                f"is too new for onnxruntime {onnxruntime.__version__}",
                path=path,
                hint="install a newer onnxruntime",
            ) from error
        raise WeightsError(f"cannot be read as ONNX ({summarize_exception(error)})", path=path) from error


def _read_card(path: Path, session: Any) -> WeightsCard:
    try:
        card = WeightsCard.parse(session.get_modelmeta().custom_metadata_map[CARD_KEY])
    except (KeyError, UnicodeDecodeError, WeightsError) as error:
        raise WeightsError(
            "not exported by doorstate: its metadata hold no weights card", path=path, field=CARD_KEY
        ) from error
    if card.states != STATES:
        raise WeightsError(f"made for states {card.states}", path=path)
    return card
