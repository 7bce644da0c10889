"""Fills the tables of docs/results.md from the data; each is between `<!-- results: NAME -->` and `<!-- end -->`."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from hil.scoring.binomial import interval
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


def _scenarios(name: str) -> Callable[[Data], str]:
    """Flights within tolerance and the mean speed into the board, a column for each scenario."""

    def made(data: Data) -> str:
        flights = data.get(name, [])
        order = [scenario for scenario in list_scenarios() if load(scenario).published]
        rows = []
        for policy in dict.fromkeys(row["policy"] for row in flights):
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
    "vision-points": _operating_points("vision", _VISION),
    "state-points": _operating_points("state", _STATE),
    "vision-ranges": _cases("points", _VISION, ("T1", "T2", "T3")),
    "motions": _cases("motions", {k: v for k, v in {**_VISION, **_STATE}.items() if "measured" not in k}),
    "vision-changes": _cases("robustness", {"vision-measured": "`vision`, measured noise"}),
    "state-changes": _cases("robustness", {"state": "`state`"}),
    "scenarios-pictures": _scenarios("scenarios-pictures"),
    "scenarios-published": _scenarios("scenarios-published"),
}
"""Name in the page -> its table from the data."""
