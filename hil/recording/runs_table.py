"""Lists runs with what was flown and the verdict; filters them, and writes tables for other tools."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from hil.recording.runs import Run, RunError, list_runs
from hil.scoring.verdict import ATTACHED, INCOMPLETE, MISSED, PERCHED, verdict_word
from kernel.toml_errors import nearest

VERDICTS = (PERCHED, ATTACHED, MISSED, INCOMPLETE, "none", "damaged")

_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # beginnings that spreadsheets take for a formula


class TableError(RuntimeError):
    """The table cannot be made; the message states what to do."""


@dataclass(frozen=True)
class Row:
    """One run. `verdict`: a word of `hil.scoring.verdict`, none (no score), or damaged (its files cannot be read).

    Errors in m, deg, m/s as in the paper's row; None where there was no contact.
    """

    run: str
    started_utc: str = ""
    identity: str = ""
    scenario: str = ""
    rig: str = ""
    policy: str = ""
    policy_sha256: str = ""
    seed: int | None = None
    host: str = ""
    state: str = ""
    verdict: str = "none"
    reasons: str = ""
    planar_m: float | None = None
    normal_alignment_deg: float | None = None
    impact_normal: float | None = None
    impact_tangential: float | None = None
    duration_s: float | None = None
    commit: str = ""
    dirty: bool | None = None
    clearance: str = ""
    path: str = ""


def rows(root: Path) -> list[Row]:
    """Every run under `root`, oldest first; a damaged one is listed as such."""
    return [_row(run) for run in list_runs(root)]


def select(
    found: Sequence[Row],
    *,
    scenario: str | None = None,
    rig: str | None = None,
    policy: str | None = None,
    verdict: str | None = None,
) -> list[Row]:
    """The rows that fit all given filters.

    `policy` also takes the beginning of a sha256, `verdict` the first word ("attached"). Raises ValueError for an
    unknown verdict.
    """
    allowed = {word.partition(",")[0]: word for word in VERDICTS}
    if verdict is not None and verdict not in (*allowed, *VERDICTS):
        raise ValueError(f'no verdict "{verdict}"{nearest(verdict, tuple(allowed))} Allowed: {", ".join(allowed)}')
    verdict = allowed.get(verdict or "", verdict)
    wanted_scenario = scenario.lower().replace("_", "-") if scenario is not None else None
    return [
        row
        for row in found
        if wanted_scenario in (None, row.scenario)
        and rig in (None, row.rig)
        and (policy in (None, row.policy) or bool(policy and row.policy_sha256.startswith(policy.lower())))
        and verdict in (None, row.verdict)
    ]


def table(found: Sequence[Row]) -> Table:
    """For a terminal, the newest last, next to the prompt: planar (m), normal (deg) and tangential (m/s) error."""
    shown = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    rigs = len({row.rig for row in found if row.rig}) > 1
    shown.add_column("run", overflow="fold", min_width=38)  # its name holds scenario, sim or real, and seed
    for column in (("rig",) if rigs else ()) + ("policy", "verdict"):
        shown.add_column(column, overflow="fold")
    for column in ("m", "deg", "m/s"):
        shown.add_column(column, justify="right")
    style = {PERCHED: "green", "damaged": "red", MISSED: "red", ATTACHED: "yellow"}
    for row in found:
        numbers = ((row.planar_m, 3), (row.normal_alignment_deg, 1), (row.impact_tangential, 2))
        shown.add_row(
            *(Text(printable(name)) for name in (row.run, *((row.rig,) if rigs else ()), row.policy)),
            Text(row.verdict, style=style.get(row.verdict, "")),
            *("-" if value is None else f"{value:.{digits}f}" for value, digits in numbers),
        )
    return shown


def write_csv(path: Path, found: Sequence[Row]) -> None:
    """All columns; a text that a spreadsheet would take for a formula gets a ' in front. Raises TableError."""
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, [field.name for field in fields(Row)])
            writer.writeheader()
            writer.writerows({name: _cell(value) for name, value in asdict(row).items()} for row in found)
    except OSError as error:
        raise TableError(f"{path}: cannot be written: {error.strerror}") from None


def write_parquet(path: Path, found: Sequence[Row]) -> None:
    """All columns, with their types also where no run has a value. Raises TableError, also without pyarrow."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        raise TableError("Parquet needs the package pyarrow: pip install pyarrow, or use --csv") from None
    kinds = {"seed": pa.int64(), "dirty": pa.bool_()}
    numbers = {"planar_m", "normal_alignment_deg", "impact_normal", "impact_tangential", "duration_s"}
    schema = pa.schema(
        [(f.name, kinds.get(f.name, pa.float64() if f.name in numbers else pa.string())) for f in fields(Row)]
    )
    try:
        parquet.write_table(pa.Table.from_pylist([asdict(row) for row in found], schema=schema), str(path))
    except OSError as error:
        raise TableError(f"{path}: cannot be written: {error}") from None


def printable(text: str) -> str:
    """`text` with what is not printable as an escape: a name from elsewhere must not steer the terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def _cell(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def _row(run: Run) -> Row:
    try:
        manifest, score = run.manifest, run.score
        return _read(run, manifest, score)
    except (RunError, AttributeError, TypeError, KeyError, ValueError) as error:
        return Row(run.path.name, verdict="damaged", reasons=str(error), path=str(run.path))


def _read(run: Run, manifest: dict[str, Any], score: dict[str, Any] | None) -> Row:
    policy, code, rig = manifest["policy"], manifest.get("code", {}), manifest["rig"]
    metrics = (score or {}).get("metrics", {})
    return Row(
        run=run.path.name,
        started_utc=manifest["wall_clock"]["started_utc"],
        identity=manifest["identity"],
        scenario=manifest["scenario"]["name"],
        rig=rig.get("name") or rig.get("title", ""),
        policy=policy["name"],
        policy_sha256=policy.get("sha256", ""),
        seed=manifest.get("seed"),
        host=manifest.get("host", ""),
        state=manifest["state"],
        verdict=_verdict(score, manifest["state"]),
        reasons="; ".join((score or {}).get("reasons", ())),
        planar_m=metrics.get("planar"),
        normal_alignment_deg=metrics.get("normal_alignment_deg"),
        impact_normal=metrics.get("impact_normal"),
        impact_tangential=metrics.get("impact_tangential"),
        duration_s=metrics.get("duration"),
        commit=code.get("commit") or "",
        dirty=code.get("dirty"),
        clearance=manifest.get("clearance", {}).get("kind", ""),
        path=str(run.path),
    )


def _verdict(score: dict[str, Any] | None, state: str) -> str:
    if score is None:
        return "none"
    return verdict_word(
        attached=score["attached"], within_tolerance=score["within_tolerance"], outcome=score["outcome"], state=state
    )
