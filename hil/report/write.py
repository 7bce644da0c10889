"""Selects the page for the given paths, and writes it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from hil.recording.reader import ReadError
from hil.recording.runs import MANIFEST, RECORDING, Run, RunError, list_runs, open_run
from hil.report import campaign, checklist, page
from hil.report.recorded.flight import load


def write_report(
    runs: Sequence[Path],
    compare: Path | None = None,
    out: Path | None = None,
    *,
    each: bool = False,
    ulog: Path | None = None,
) -> Path:
    """Write the report of `runs` and return its path: of one run, of two side by side, of a campaign of several, or of
    a checklist's record (.json), beside it.

    `each`: of a campaign, also the report of each run that can be read, which the page then links to. `ulog`: the
    autopilot's own log of the run.

    Raises ReadError or RunError if a path is no run, RecordError if it is no record, ValueError for an invalid choice
    or a `ulog` that is no log, OSError if `out` cannot be written.
    """
    if len(runs) == 1 and runs[0].suffix == ".json":
        if compare is not None or each or ulog is not None:
            raise ValueError(f"{runs[0]} is a checklist's record: --compare, --ulog and --each are for runs")
        return _written(checklist.render(runs[0]), out or runs[0].with_suffix(".html"))
    folders = _expand(runs)
    if ulog is not None and len(folders) != 1:
        raise ValueError(f"--ulog is the log of one flight; {len(folders)} runs were given")
    if compare is not None:
        if len(folders) != 1:
            raise ValueError(f"--compare puts one run beside another; {len(folders)} runs were given before it")
        first, second = load(folders[0], ulog), load(compare)
        html, target = page.render([first, second]), _beside(folders[0], f"report_vs_{second.name}.html")
    elif len(folders) == 1:
        html, target = page.render([load(folders[0], ulog)]), _beside(folders[0], "report.html")
    else:
        for folder in folders if each else ():
            with suppress(ReadError, RunError):
                write_report([folder])
        target = _common(folders) / "campaign.html"
        html = campaign.render([open_run(folder) for folder in folders], folder=(out or target).resolve().parent)
    return _written(html, out or target)


def _written(html: str, target: Path) -> Path:
    scratch = target.with_name(f".{target.name}.new")
    try:
        scratch.write_text(html, encoding="utf-8")
        scratch.replace(target)
    finally:
        scratch.unlink(missing_ok=True)
    return target


def _expand(paths: Sequence[Path]) -> list[Path]:
    """Replace folders of runs by the runs in them."""
    found: list[Path] = []
    for path in paths:
        inside: list[Run] = []
        if path.is_dir() and not (path / MANIFEST).exists() and not (path / RECORDING).exists():
            inside = list_runs(path)
            if not inside:
                raise RunError(f"{path}: is neither a run folder (no {MANIFEST}) nor a folder of runs")
        found += [run.path for run in inside] or [path]
    return found


def _beside(run: Path, name: str) -> Path:
    return run / name if run.is_dir() else run.with_name(f"{run.stem}_{name}" if run.name != RECORDING else name)


def _common(folders: Sequence[Path]) -> Path:
    parents = {folder.resolve().parent for folder in folders}
    return parents.pop() if len(parents) == 1 else Path()
