"""Fills the tables of docs/results.md from the data; each is between `<!-- results: NAME -->` and `<!-- end -->`."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from hil.results.experiments import ABLATIONS, LEARNED
from hil.scoring.binomial import interval
from policies.evaluation.maps import MOTIONS
from policies.evaluation.plot import comparison, percents
from scenarios.paper import SimulatedRow, published
from scenarios.spec import list_scenarios, load

_BLOCK = re.compile(r"(<!-- results: ([a-z-]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_HEADS = ("", "perched, %", "time, s", "position, m", "normal, rad", "tangential, m/s", "into the board, m/s")
_VISION = {
    "vision-published": "`vision`, published noise",
    "planner-published": "`planner`, published noise",
    "vision-measured": "`vision`, measured noise",
    "planner-measured": "`planner`, measured noise",
}
_POINTS = {**_VISION, "vision-to-2.5": "the recipe `vision`, speeds to 2.5 m/s, published noise"}
_ABLATIONS = {f"ablation-{variant}": title for variant, (title, _) in ABLATIONS.items()}
_FIGURES = {
    "ablation-success.svg": ("Vision ablations: success, percent", "success"),
    "ablation-rho.svg": ("Vision ablations: mean rho, percent", "rho"),
}
_STATE = {
    "state": "`state`",
    "fast-perching": "Fast-Perching",
    "fast-perching-ctrv": "Fast-Perching, keeping the turn rate",
}

Data = Mapping[str, Any]
"""Experiment's name -> its data; an experiment that was not measured is missing."""


class PageError(ValueError):
    """The page names a table that does not exist."""


def fill(page: str, data: Data) -> str:
    """`page` with every table made anew. Raises PageError for the name of a table that does not exist."""

    def table(found: re.Match[str]) -> str:
        if found[2] not in TABLES:
            raise PageError(f"no table '{found[2]}': there are {', '.join(TABLES)}")
        return f"{found[1]}{TABLES[found[2]](data)}{found[3]}"

    return _BLOCK.sub(table, page)


def _markdown(heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _missing(data: Data, names: Mapping[str, str]) -> str:
    left = [name for name in names if name not in data]
    return f"\nNot measured yet (`perch-hil results` does it): {', '.join(left)}.\n" if left else ""


def _rate(row: Mapping[str, Any]) -> str:
    low, high = row["interval_95"]
    return f"{row['success']:.2f} ({low:.1f}-{high:.1f})"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _operating_points(stage: str, names: Mapping[str, str]) -> Callable[[Data], str]:
    """Five metrics at T1, T2, T3, the paper's row first."""

    def made(data: Data) -> str:
        rows = []
        for point in ("T1", "T2", "T3"):
            paper = published(f"{stage}.{point.lower()}")
            assert isinstance(paper, SimulatedRow)
            means = (paper.duration, 2), (paper.position_error, 3), (paper.normal_error, 3), (paper.tangential_speed, 3)
            numbers = [f"{value:.{digits}f}" for value, digits in means]
            rows.append((f"{point}, the paper", f"{paper.success_percent:.2f}", *numbers, "-"))
            for name, title in names.items():
                found = (
                    next((row for row in data[name]["points"] if row["name"] == point), None) if name in data else None
                )
                if found is not None:
                    means = (found["duration"], 2), (found["position_error"], 3), (found["normal_error"], 3)
                    more = (found["tangential_speed"], 3), (found["normal_speed"], 2)
                    rows.append((f"{point}, {title}", _rate(found), *(_number(*pair) for pair in (*means, *more))))
        return _markdown(_HEADS, rows) + _missing(data, names)

    return made


def _cases(group: str, names: Mapping[str, str], skip: tuple[str, ...] = ()) -> Callable[[Data], str]:
    """Success of several policies, a line for each case of `group` in the data."""

    def made(data: Data) -> str:
        there = {name: {row["name"]: row for row in data[name][group]} for name in names if name in data}
        cases = [case for case in next(iter(there.values()), {}) if case not in skip]
        rows = [(case, *(_rate(found[case]) for found in there.values())) for case in cases]
        return _markdown(("", *(names[name] for name in there)), rows) + _missing(data, names)

    return made


def _trajectories(data: Data) -> str:
    """Success of what learns on each trajectory, by a network that was trained on it alone."""
    rows = []
    for family in MOTIONS:
        mine = {method: data.get(f"{method}-{family}") for method in LEARNED}
        cases = [row["name"] for row in next(filter(None, mine.values()), {"motions": []})["motions"]]
        for case in (case for case in cases if case.startswith(f"{family} ")):
            found = [
                next((row for row in one["motions"] if row["name"] == case), None) if one else None
                for one in mine.values()
            ]
            rows.append((case, *("-" if row is None else _rate(row) for row in found)))
    names = {f"{method}-{family}": "" for method in LEARNED for family in MOTIONS}
    return _markdown(("", *(title for title, *_ in LEARNED.values())), rows) + _missing(data, names)


def _ablations(data: Data) -> str:
    """Success and mean rho of each variant at the end of its training."""
    rows = []
    for name, title in _ABLATIONS.items():
        if name in data:
            ends = [percents(data[name], column)[-1] for column in ("success", "rho")]
            rows.append((title, f"{ends[0]:.1f}", f"{ends[1] / 100.0:.3f}"))
    pictures = "".join(f"\n![{title}](../results/{file})\n" for file, (title, _) in _FIGURES.items()) if rows else ""
    return _markdown(("", "perched, %", "mean rho"), rows) + _missing(data, _ABLATIONS) + pictures


def figures(data: Data) -> dict[str, str]:
    """SVG files of the page that no command draws, by name; those whose data is there."""
    curves = {title: data[name] for name, title in _ABLATIONS.items() if name in data}
    if not curves:
        return {}
    return {file: comparison(curves, column, title) for file, (title, column) in _FIGURES.items()}


def _scenarios(name: str) -> Callable[[Data], str]:
    """Flights within tolerance and the mean speed into the board, a column for each scenario."""

    def made(data: Data) -> str:
        flights = data.get(name, [])
        order = [scenario for scenario in list_scenarios() if load(scenario).published]
        rows = []
        for policy in sorted({row["policy"] for row in flights}, reverse=True):  # several fly at a time
            mine = [row for row in flights if row["policy"] == policy]
            groups = [[row for row in mine if row["scenario"] == scenario] for scenario in order]
            rows.append((f"`{policy}`", *map(_count, groups), _count(mine, exact=True)))
            rows.append(("into the board, m/s", *map(_impact, groups), _impact(mine)))
        titles = (load(scenario).title.partition(":")[0] for scenario in order)
        return _markdown(("", *titles, "all"), rows) + _missing(data, {name: ""})

    return made


def _count(flights: list[dict[str, Any]], exact: bool = False) -> str:
    hits, total = sum(row["verdict"] == "perched" for row in flights), len(flights)
    low, high = interval(hits, total) if exact else (0.0, 1.0)
    return f"{hits} of {total}" + (f" ({100 * low:.1f}-{100 * high:.1f} %)" if exact else "")


def _impact(flights: list[dict[str, Any]]) -> str:
    speeds = [-row["impact_normal"] for row in flights if row["verdict"] == "perched"]
    return f"{sum(speeds) / len(speeds):.2f}" if speeds else "-"


TABLES: dict[str, Callable[[Data], str]] = {
    "vision-points": _operating_points("vision", _POINTS),
    "state-points": _operating_points("state", _STATE),
    "vision-ranges": _cases("points", _VISION, ("T1", "T2", "T3")),
    "motions": _cases("motions", {k: v for k, v in {**_VISION, **_STATE}.items() if "measured" not in k}),
    "vision-changes": _cases("robustness", {"vision-measured": "`vision`, measured noise"}),
    "state-changes": _cases("robustness", {"state": "`state`"}),
    "trajectories": _trajectories,
    "ablations": _ablations,
    "scenarios-pictures": _scenarios("scenarios-pictures"),
    "scenarios-published": _scenarios("scenarios-published"),
}
"""Name in the page -> its table from the data."""
