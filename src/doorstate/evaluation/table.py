# SPDX-License-Identifier: Apache-2.0
"""Tables: the numbers of a pandas frame, formatted column by column and written as Markdown, LaTeX or CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import pandas as pd

UNDEFINED = "–"  # in place of NaN; an empty field in CSV


@dataclass(frozen=True)
class Column:
    """Column of a table: a title, the columns of the frame that it shows, and the format of their values."""

    title: str
    names: tuple[str, ...]
    format: Callable[..., str]
    is_label: bool = False  # names a row; such columns come first
    is_shaded: bool = False  # the page shades the cell by the first value, a share


@dataclass(frozen=True)
class Table:
    """Rows of formatted cells; the first `text_columns` columns name a row, the others hold numbers."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    text_columns: int = 1
    frame: pd.DataFrame | None = field(default=None, compare=False, repr=False)  # numbers of the cells
    shades: tuple[tuple[float | None, ...], ...] = field(default=(), compare=False, repr=False)

    @classmethod
    def from_frame(cls, title: str, frame: pd.DataFrame, columns: Sequence[Column], note: str = "") -> Table:
        """Format a frame.

        Args:
            title: title of the table.
            frame: numbers and labels; one row for each row of the table.
            columns: columns to show, labels first.
            note: text below the table.
        """
        cells: list[list[str]] = []
        shades: list[list[float | None]] = []
        for column in columns if len(frame) else ():
            cells.append(_format(frame, column))
            shades.append(frame[column.names[0]].tolist() if column.is_shaded else [None] * len(frame))
        return cls(
            title,
            tuple(column.title for column in columns),
            tuple(zip(*cells, strict=True)),
            note,
            sum(column.is_label for column in columns),
            frame,
            tuple(zip(*shades, strict=True)) if any(column.is_shaded for column in columns) else (),
        )

    def to_markdown(self) -> str:
        """Format as a GitHub-flavoured Markdown table with its title and note."""
        rule = ["---"] * self.text_columns + ["---:"] * (len(self.columns) - self.text_columns)
        lines = [_markdown_row(self.columns), _markdown_row(rule), *map(_markdown_row, self.rows)]
        return "\n\n".join(part for part in (f"**{self.title}**", "\n".join(lines), self.note) if part) + "\n"

    def to_latex(self) -> str:
        """Format as a LaTeX longtable with its title; needs the packages booktabs and longtable."""
        align = "l" * self.text_columns + "r" * (len(self.columns) - self.text_columns)
        cells = pd.DataFrame(self.rows, columns=pd.Index(self.columns))
        return cells.to_latex(
            index=False, escape=True, longtable=True, caption=self.title, column_format=align
        )

    def to_csv(self) -> str:
        """Write the numbers as CSV, 12 significant digits, an undefined one as an empty field; cells if there are none.

        Title and note are left out.
        """
        if self.frame is not None:
            return self.frame.to_csv(index=False, lineterminator="\n", float_format="%.12g")
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(["" if cell == UNDEFINED else cell for cell in row] for row in self.rows)
        return text.getvalue()


def label_column(name: str, title: str | None = None) -> Column:
    """Return a column of text that names the rows."""
    return Column(title or name, (name,), _text, is_label=True)


def text_column(name: str, title: str | None = None) -> Column:
    """Return a column of text, a dash where it is missing."""
    return Column(title or name, (name,), _text)


def count_column(name: str, title: str | None = None) -> Column:
    """Return a column of whole numbers."""
    return Column(title or name, (name,), lambda value: number(value, 0))


def number_column(name: str, title: str | None = None, digits: int = 4) -> Column:
    """Return a column of numbers with fixed digits."""
    return Column(title or name, (name,), lambda value: number(value, digits))


def plain_column(name: str, title: str | None = None) -> Column:
    """Return a column of numbers with as few digits as they need, at most six."""
    return Column(title or name, (name,), lambda value: UNDEFINED if math.isnan(value) else f"{value:g}")


def interval_column(name: str, title: str, digits: int = 4) -> Column:
    """Return a column of intervals from `<name>_low` and `<name>_high`."""
    return Column(title, (f"{name}_low", f"{name}_high"), lambda low, high: interval((low, high), digits))


def deviation_column(name: str, title: str, digits: int = 4) -> Column:
    """Return a column `mean ± deviation` from `<name>_mean` and `<name>_deviation`."""
    names = (f"{name}_mean", f"{name}_deviation")
    return Column(title, names, lambda mean, deviation: mean_deviation((mean, deviation), digits))


def p_value_column(name: str, title: str) -> Column:
    """Return a column of p-values."""
    return Column(title, (name,), p_value)


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


def _format(frame: pd.DataFrame, column: Column) -> list[str]:
    values = (frame[name].tolist() for name in column.names)
    return [column.format(*row) for row in zip(*values, strict=True)]


def _text(value: object) -> str:
    return UNDEFINED if value is None or value != value or value == "" else str(value)


def _markdown_row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"
