"""The experiments of docs/results.md: each is one or two commands of `perch-hil`, the last of which prints the data."""

from __future__ import annotations

from dataclasses import dataclass

FLIGHTS = ("scenario", "policy", "seed", "verdict", "planar_m", "normal_alignment_deg", "impact_normal", "reasons")


@dataclass(frozen=True)
class Experiment:
    """`commands`: arguments of `perch-hil`; {results} stands for the data's folder, {runs} for the flights' folder.

    `keep`: where the data is a list of rows, the fields that are kept; empty: all.
    """

    name: str
    text: str
    commands: tuple[str, ...]
    keep: tuple[str, ...] = ()


def _flights(name: str, text: str, arguments: str) -> Experiment:
    campaign = f"campaign {arguments} --pictures none --out {{runs}}"
    return Experiment(name, text, (campaign, "runs {runs} --json"), FLIGHTS)


EXPERIMENTS = (
    Experiment(
        "vision-published",
        "vision on the published noise: points, motions, map",
        ("policy evaluate vision --motions --heatmap {results}/vision-map.svg --json",),
    ),
    Experiment(
        "vision-measured",
        "vision on the measured noise: points, other vehicles and cameras",
        ("policy evaluate vision --noise measured --robust --json",),
    ),
    Experiment(
        "state",
        "state, told where the board is: points, motions, other vehicles, map",
        ("policy evaluate state --motions --robust --heatmap {results}/state-map.svg --json",),
    ),
    Experiment(
        "planner-published",
        "planner on the published noise: points, motions",
        ("policy evaluate planner --motions --json",),
    ),
    Experiment(
        "planner-measured", "planner on the measured noise", ("policy evaluate planner --noise measured --json",)
    ),
    Experiment(
        "fast-perching",
        "Fast-Perching, told where the board is: points, motions",
        ("policy evaluate fast-perching --episodes 200 --motions --json",),
    ),
    Experiment(
        "fast-perching-ctrv",
        "Fast-Perching that keeps the board's turn rate: points, motions",
        ("policy evaluate fast-perching-ctrv --episodes 200 --motions --json",),
    ),
    _flights("scenarios-pictures", "six scenarios with pictures", "--policy vision --seeds 9300..9339"),
    _flights(
        "scenarios-published",
        "six scenarios on the published noise",
        "--policy vision --policy planner --camera model --seeds 9300..9319",
    ),
)
"""Seeds 9300 and above were used for nothing before: no setting was chosen on them."""
