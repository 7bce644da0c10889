"""Success of policies in the training environment as tables and data, beside the published rows."""

from __future__ import annotations

from typing import Any

from rich import box
from rich.table import Table

from hil.scoring.binomial import interval
from policies.evaluation.evaluate import Row, as_data
from scenarios.paper import SimulatedRow, published

_HEADS = ("point", "perched", "95 %", "time", "pos", "angle", "v_t", "v_n")
_UNITS = ("", "%", "", "s", "m", "rad", "m/s", "m/s")


def _published(row: Row, stage: str) -> SimulatedRow | None:
    """The paper's row for this point, if it has one."""
    if row.name not in ("T1", "T2", "T3"):
        return None
    paper = published(f"{stage}.{row.name.lower()}")
    assert isinstance(paper, SimulatedRow)
    return paper


def policy_data(rows: list[Row], stage: str) -> list[dict[str, Any]]:
    """The rows as plain data, with their exact 95 % interval (percent) and the paper's row; no mean is None."""
    found = []
    for row, data in zip(rows, as_data(rows), strict=True):
        low, high = interval(row.hits, row.episodes)
        paper = _published(row, stage)
        data = {k: None if v != v else v for k, v in data.items()}
        row_of_paper = paper.model_dump() if paper else None
        found.append({**data, "interval_95": [100.0 * low, 100.0 * high], "paper": row_of_paper})
    return found


def policy_table(rows: list[Row], stage: str, title: str) -> Table:
    """The rows as a table of at most 80 columns; the paper's in between, dim. Means are over successes.

    v_t, v_n: tangential speed and speed into the board at contact.
    """
    grid = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for head, unit in zip(_HEADS, _UNITS, strict=True):
        grid.add_column(f"{head}\n{unit}", justify="left" if head == "point" else "right", no_wrap=True)
    for row in rows:
        low, high = interval(row.hits, row.episodes)
        means = (row.duration, 2), (row.position_error, 3), (row.normal_error, 3), (row.tangential_speed, 2)
        shown = [f"{value:.{digits}f}" if row.hits else "-" for value, digits in (*means, (row.normal_speed, 2))]
        grid.add_row(row.name, f"{row.success:.2f}", f"{100 * low:.1f}-{100 * high:.1f}", *shown)
        paper = _published(row, stage)
        if paper is not None:
            grid.add_row(
                "   paper", f"{paper.success_percent:.2f}", "", f"{paper.duration:.2f}", f"{paper.position_error:.3f}",
                f"{paper.normal_error:.3f}", f"{paper.tangential_speed:.2f}", style="dim",
            )  # fmt: skip
    return grid


def note_lines(rows: list[Row]) -> list[str]:
    """What the table has no room for, a line a row: the middle 90 % of v_n, sight, and why flights failed."""
    lines = []
    for row in rows:
        into = f"into the board at {row.normal_speed_5:.2f}-{row.normal_speed_95:.2f} m/s, " if row.hits else ""
        most = sorted(row.causes.items(), key=lambda item: -item[1])
        failed = ", ".join(f"{cause.replace('_', ' ')} {count}" for cause, count in most)
        lines.append(f"{row.name}: {into}seen {row.seen:.0f} %" + (f"; failed: {failed}" if failed else ""))
    return lines
