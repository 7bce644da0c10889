"""One evaluation of one policy from the command line: tables and map, with progress on stderr."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hil.campaign.evaluating import Evaluating
from hil.campaign.workers.opening import open_workers
from hil.campaign.workers.work import Workers
from hil.cli.legends import EVALUATION
from hil.cli.policy_table import note_lines, policy_data, policy_table
from hil.cli.screen import say, screen
from policies.environment.config import TICK
from policies.evaluation.contenders import open_contender
from policies.evaluation.evaluate import Case, Policy, Row, evaluation_seed, fly_cases, points
from policies.evaluation.maps import HeatMap, heatmap, map_cells, motions, robustness

_NOISE = {"paper": "the paper's noise", "measured": "our detector's measured noise (about a tenth of the paper's)"}
_CASE_SHARE, _CELL_SHARE = 0.25, 0.05  # episodes of a motion or another vehicle and of a cell, of those of a point


@dataclass(frozen=True)
class Request:
    """Options from the command line. `time_limit` s; `picture`: where the map goes, or None; `cluster`: its address, or
    None to fly here; `airframe`: None for the one that the policy was made for."""

    policy: str
    episodes: int = 2000
    stage: str | None = None
    noise: str = "paper"
    hover: bool = False
    time_limit: float = 5.0
    motions: bool = False
    robust: bool = False
    picture: Path | None = None
    seed: int = 0
    cluster: str | None = None
    airframe: str | None = None


@dataclass(frozen=True)
class Evaluation:
    """Result of an evaluation."""

    request: Request
    name: str
    stage: str
    airframe: str
    rows: list[Row]
    motion_rows: list[Row]
    robust_rows: list[Row]
    map: HeatMap | None

    def conditions(self) -> str:
        """The conditions of the evaluation, in words."""
        asked = self.request
        start = "hovering start" if asked.hover else "the paper's start"
        seen = (
            f"on a camera's belief with {_NOISE[asked.noise]}" if self.stage == "vision" else "told where the board is"
        )
        on = f"{self.name} on {self.airframe}, {self.stage} stage"
        return f"{on}: {seen}, {start}, {asked.time_limit:g} s, seed {asked.seed}"

    def data(self) -> dict[str, Any]:
        """As plain data, for JSON."""
        asked = self.request
        found = self.map
        return {
            "policy": asked.policy,
            "name": self.name,
            "stage": self.stage,
            "airframe": self.airframe,
            "noise": asked.noise if self.stage == "vision" else None,
            "hover": asked.hover,
            "time_limit": asked.time_limit,
            "seed": asked.seed,
            "points": policy_data(self.rows, self.stage),
            "motions": policy_data(self.motion_rows, self.stage),
            "robustness": policy_data(self.robust_rows, self.stage),
            "heatmap": found and {**vars(found), "picture": str(asked.picture)},
        }

    def show(self) -> None:
        """Print the tables."""
        console = screen()
        say(self.conditions())
        groups = (("points", self.rows), ("motions", self.motion_rows), ("other vehicles", self.robust_rows))
        for what, rows in groups:
            if rows:
                console.print(policy_table(rows, self.stage, f"{what}, {rows[0].episodes} episodes each"))
                say("\n".join(note_lines(rows)))
        say(f"\n{EVALUATION}")
        if self.map is not None:
            picture = self.request.picture
            assert picture is not None
            say(f"wrote {picture} and {picture.with_suffix('.csv')}")


class _Flyer:
    """Flies cases with the requested policy, here or by workers, with a progress bar on stderr."""

    def __init__(self, request: Request, policy: Policy, workers: Workers | None) -> None:
        self._work = Evaluating(request.policy, request.noise)
        self._policy, self._workers = policy, workers

    def __call__(self, what: str, cases: list[Case]) -> list[Row]:
        """A line for each case, in their order."""
        with _bar(what) as watch:
            if self._workers is None:
                return fly_cases(self._policy, cases, self._work.noise, watch)
            found: dict[str, Row] = {}
            for row in self._workers.each(self._work, cases):
                found[row.name] = row
                watch(len(found) / len(cases))
        return [found[case.name] for case in cases]


@contextmanager
def _bar(what: str):
    """A progress bar on stderr that takes shares from 0 to 1; nothing where stderr is not a terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(what, total=1.0)
        watch: Callable[[float], None] = lambda share: progress.update(task, completed=share)  # noqa: E731
        yield watch


def evaluate_policy(request: Request) -> Evaluation:
    """Evaluate as requested.

    Raises ContractError or ValueError for what cannot be flown, ClusterError or WorkersError for a cluster that is
    not there, does not fit or was lost, OSError for the picture.
    """
    contender = open_contender(request.policy)
    changes: dict[str, Any] = {"warm": float(request.hover), "limit": round(request.time_limit / TICK)}
    if request.airframe is not None:
        changes["airframe"] = request.airframe
    config = contender.config(request.stage, evaluation_seed(request.seed), **changes)
    with nullcontext() if request.cluster is None else open_workers(request.cluster, None) as workers:
        fly = _Flyer(request, contender.policy, workers)
        rows = fly("points", points(config, request.episodes))
        episodes = max(10, round(_CASE_SHARE * request.episodes))
        motion_rows = fly("motions", motions(config, episodes)) if request.motions else []
        robust_rows = fly("other vehicles", robustness(config, episodes)) if request.robust else []
        found = None
        if request.picture is not None:
            found = heatmap(fly("map", map_cells(config, max(10, round(_CELL_SHARE * request.episodes)))))
    evaluation = Evaluation(
        request, contender.name, config.stage, config.airframe, rows, motion_rows, robust_rows, found
    )
    if found is not None and request.picture is not None:
        request.picture.parent.mkdir(parents=True, exist_ok=True)
        request.picture.write_text(found.svg(evaluation.conditions()))
        request.picture.with_suffix(".csv").write_text(found.csv())
    return evaluation
