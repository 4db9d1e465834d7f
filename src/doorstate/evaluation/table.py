# SPDX-License-Identifier: Apache-2.0
"""A table of finished text cells and its three file formats; a cell is formatted once, when it is made."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass

UNDEFINED = "–"  # in place of NaN; an empty field in CSV

_LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        **{character: "\\" + character for character in "&%$#_{}"},
        "–": "--",
        "±": r"$\pm$",
        "×": r"$\times$",
        "°": r"$^{\circ}$",
        "<": "$<$",
        ">": "$>$",
        "→": r"$\to$",
    }
)


@dataclass(frozen=True)
class Table:
    """Rows of text cells; the first `text_columns` columns name a row, the others hold numbers."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    text_columns: int = 1

    def to_markdown(self) -> str:
        """Format as a GitHub-flavoured Markdown table with its title and note."""
        rule = ["---"] * self.text_columns + ["---:"] * (len(self.columns) - self.text_columns)
        lines = [_markdown_row(self.columns), _markdown_row(rule), *map(_markdown_row, self.rows)]
        return "\n\n".join(part for part in (f"**{self.title}**", "\n".join(lines), self.note) if part) + "\n"

    def to_latex(self) -> str:
        """Format as a LaTeX longtable; needs the packages booktabs and longtable (strata outgrow a page)."""
        align = "l" * self.text_columns + "r" * (len(self.columns) - self.text_columns)
        lines = [
            rf"\begin{{longtable}}{{{align}}}",
            rf"\caption{{{self.title.translate(_LATEX)}}}\\",
            r"\toprule",
            _latex_row(self.columns),
            r"\midrule",
            r"\endhead",
            r"\bottomrule",
            r"\endfoot",
            *map(_latex_row, self.rows),
            r"\end{longtable}",
        ]
        if self.note:
            lines.append(rf"{{\small {self.note.translate(_LATEX)}\par}}")
        return "\n".join(lines) + "\n"

    def to_csv(self) -> str:
        """Format as CSV with a header line; an undefined cell is empty, title and note are left out."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(["" if cell == UNDEFINED else cell for cell in row] for row in self.rows)
        return text.getvalue()


def _markdown_row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def _latex_row(cells: Iterable[str]) -> str:
    return " & ".join(cell.translate(_LATEX) for cell in cells) + r" \\"


def number(value: float, digits: int = 4) -> str:
    """Format a number with fixed digits, NaN as a dash."""
    return UNDEFINED if math.isnan(value) else f"{value:.{digits}f}"


def interval(low_high: tuple[float, float], digits: int = 4) -> str:
    """Format an interval as `low–high`, an undefined one as a dash."""
    low, high = low_high
    return UNDEFINED if math.isnan(low) else f"{low:.{digits}f}–{high:.{digits}f}"


def mean_deviation(mean_and_deviation: tuple[float, float], digits: int = 4) -> str:
    """Format `mean ± deviation`; the mean alone where there is no deviation."""
    mean, deviation = mean_and_deviation
    return number(mean, digits) + ("" if math.isnan(deviation) else f" ± {deviation:.{digits}f}")


def p_value(value: float) -> str:
    """Format a p-value; below 0.0001 as that bound."""
    return "<0.0001" if value < 1e-4 else f"{value:.4f}"
