# SPDX-License-Identifier: Apache-2.0
"""Tables read back from each of their formats."""

from __future__ import annotations

import csv
import io
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.evaluation.table import UNDEFINED, Table, interval, mean_deviation, number, p_value

NAN = float("nan")
TABLE = Table(
    "Scores & more",
    ("network", "F1", "spread"),
    (("pointnet_2", "0.9900", "0.9 ± 0.1"), ("a|b", UNDEFINED, "<0.0001")),
    "100 % honest",
)
cells = st.text(st.sampled_from("ab09&%$#_{}~^\\|<>±–"), min_size=1, max_size=8).map(str.strip).filter(bool)


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
    assert TABLE.to_markdown().startswith("**Scores & more**\n\n")
    assert TABLE.to_markdown().endswith("\n\n100 % honest\n")


def test_csv_reads_back_with_undefined_cells_empty() -> None:
    header, *rows = csv.reader(io.StringIO(TABLE.to_csv()))
    assert header == list(TABLE.columns)
    assert [tuple(cell or UNDEFINED for cell in row) for row in rows] == list(TABLE.rows)
    assert UNDEFINED not in TABLE.to_csv()


def test_latex_by_hand() -> None:
    assert TABLE.to_latex().splitlines() == [
        r"\begin{longtable}{lrr}",
        r"\caption{Scores \& more}\\",
        r"\toprule",
        r"network & F1 & spread \\",
        r"\midrule",
        r"\endhead",
        r"\bottomrule",
        r"\endfoot",
        r"pointnet\_2 & 0.9900 & 0.9 $\pm$ 0.1 \\",
        r"a|b & -- & $<$0.0001 \\",
        r"\end{longtable}",
        r"{\small 100 \% honest\par}",
    ]


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(cells, cells), min_size=1, max_size=4))
def test_latex_escapes_every_special_character(rows: list[tuple[str, str]]) -> None:
    body = Table("", ("a", "b"), tuple(rows)).to_latex().split("\\endfoot\n")[1].split("\\end{longtable}")[0]
    named = {
        r"\textbackslash{}": "\\",
        r"\textasciitilde{}": "~",
        r"\textasciicircum{}": "^",
        r"$\pm$": "±",
        "$<$": "<",
        "$>$": ">",
        "--": "–",
        **{"\\" + character: character for character in "&%$#_{}"},
    }
    pattern = re.compile("|".join(map(re.escape, named)))
    for line, row in zip(body.splitlines(), rows, strict=True):
        first, second = re.split(r"(?<!\\) & ", line.removesuffix(r" \\"))
        assert (pattern.sub(lambda m: named[m[0]], first), pattern.sub(lambda m: named[m[0]], second)) == row
        assert not re.search(r"[&%#_~^]", pattern.sub("", first))


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(cells, cells), min_size=1, max_size=4))
def test_csv_reads_back_whatever_the_cells(rows: list[tuple[str, str]]) -> None:
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
def test_numbers(text: str, expected: str) -> None:
    assert text == expected
