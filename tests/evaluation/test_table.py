# SPDX-License-Identifier: Apache-2.0
"""Tables: formatted from a frame, and read back from each of their forms."""

from __future__ import annotations

import csv
import io
import re

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.evaluation.table import (
    UNDEFINED,
    Table,
    count_column,
    deviation_column,
    interval,
    interval_column,
    label_column,
    mean_deviation,
    number,
    number_column,
    p_value,
    p_value_column,
    plain_column,
    text_column,
)

NAN = float("nan")
TABLE = Table(
    "Scores & more",
    ("network", "F1", "spread"),
    (("pointnet_2", "0.9900", "0.9 ± 0.1"), ("a|b", UNDEFINED, "<0.0001")),
    "100 % exact",
)
cells = st.text(st.sampled_from("ab09&%$#_{}~^\\|<>±–"), min_size=1, max_size=8).map(str.strip).filter(bool)


def test_a_frame_is_formatted_column_by_column() -> None:
    frame = pd.DataFrame(
        {
            "method": ["net", "rule"],
            "region": ["red", None],
            "samples": [3, NAN],
            "f1": [0.98765, NAN],
            "f1_low": [0.9, NAN],
            "f1_high": [1.0, NAN],
            "f1_mean": [0.5, 0.5],
            "f1_deviation": [0.25, NAN],
            "p": [0.00001, 0.5],
            "edge": [1.5, 20.0],
        }
    )
    columns = (
        label_column("method"),
        text_column("region"),
        count_column("samples"),
        number_column("f1", "F1"),
        interval_column("f1", "95 %", 2),
        deviation_column("f1", "over folds", 1),
        p_value_column("p", "p"),
        plain_column("edge"),
    )
    table = Table.from_frame("Scores", frame, columns, "note")
    assert table.columns == ("method", "region", "samples", "F1", "95 %", "over folds", "p", "edge")
    assert table.rows == (
        ("net", "red", "3", "0.9877", "0.90–1.00", "0.5 ± 0.2", "<0.0001", "1.5"),
        ("rule", *[UNDEFINED] * 4, "0.5", "0.5000", "20"),
    )
    assert table.text_columns == 1
    numbers = pd.read_csv(io.StringIO(table.to_csv()))
    assert numbers["f1"][0] == 0.98765
    assert numbers["samples"].isna().tolist() == [False, True]


def test_an_empty_frame_has_no_rows() -> None:
    table = Table.from_frame("Scores", pd.DataFrame(), (label_column("method"), number_column("f1")))
    assert table.rows == table.shades == ()
    assert table.columns == ("method", "f1")


def _markdown_rows(text: str) -> list[list[str]]:
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [
        [cell.strip().replace(r"\|", "|") for cell in re.split(r"(?<!\\)\|", line[1:-1])] for line in lines
    ]


def test_markdown_reads_back() -> None:
    header, rule, *rows = _markdown_rows(TABLE.to_markdown())
    assert header == list(TABLE.columns)
    assert rule == ["---", "---:", "---:"]
    assert [tuple(row) for row in rows] == list(TABLE.rows)
    assert TABLE.to_markdown().startswith(f"**{TABLE.title}**\n\n")
    assert TABLE.to_markdown().endswith(f"\n\n{TABLE.note}\n")


def test_csv_reads_back_with_undefined_cells_empty() -> None:
    header, *rows = csv.reader(io.StringIO(TABLE.to_csv()))
    assert header == list(TABLE.columns)
    assert [tuple(cell or UNDEFINED for cell in row) for row in rows] == list(TABLE.rows)
    assert UNDEFINED not in TABLE.to_csv()


def test_latex_is_a_longtable_with_escaped_cells() -> None:
    lines = TABLE.to_latex().splitlines()
    assert lines[0] == r"\begin{longtable}{lrr}"
    assert any(line.startswith(r"pointnet\_2 & 0.9900 & ") for line in lines)
    assert lines[-1] == r"\end{longtable}"


@settings(max_examples=60)
@given(st.lists(st.tuples(cells, cells), min_size=1, max_size=4))
def test_csv_of_any_cells_reads_back(rows: list[tuple[str, str]]) -> None:
    read = list(csv.reader(io.StringIO(Table("", ("a", "b"), tuple(rows)).to_csv())))[1:]
    assert [tuple(cell or UNDEFINED for cell in row) for row in read] == rows


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (number(0.98765), "0.9877"),
        (number(NAN), UNDEFINED),
        (number(12.6, 0), "13"),
        (interval((0.9, 1.0)), "0.9000–1.0000"),
        (interval((NAN, NAN)), UNDEFINED),
        (mean_deviation((0.5, 0.25)), "0.5000 ± 0.2500"),
        (mean_deviation((0.5, NAN)), "0.5000"),
        (mean_deviation((NAN, NAN)), UNDEFINED),
        (p_value(0.04321), "0.0432"),
        (p_value(0.00001), "<0.0001"),
    ],
)
def test_formats(text: str, expected: str) -> None:
    assert text == expected
