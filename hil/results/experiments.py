"""The experiments of docs/results.md: each is one or two commands of `perch-hil`, the last of which prints the data."""

from __future__ import annotations

from dataclasses import dataclass

from policies.evaluation.maps import MOTIONS

FLIGHTS = ("scenario", "policy", "seed", "verdict", "planar_m", "normal_alignment_deg", "impact_normal", "reasons")


@dataclass(frozen=True)
class Experiment:
    """`commands`: arguments of `perch-hil`; {results} stands for the data's folder, {runs} for that of its flights or
    of its training.

    `networks`: files of policies/checkpoints that it flies or learns from: another one asks for new data. `keep`: where
    the data is a list of rows, the fields that are kept; empty: all.
    """

    name: str
    text: str
    networks: tuple[str, ...]
    commands: tuple[str, ...]
    keep: tuple[str, ...] = ()


VISION, STATE, PREDICTOR, PARENT = "vision.onnx", "state.onnx", "predictor.npz", "plain/state.onnx"


def _flights(name: str, text: str, networks: tuple[str, ...], arguments: str) -> Experiment:
    campaign = f"campaign {arguments} --pictures none --out {{runs}}"
    return Experiment(name, text, networks, (campaign, "runs {runs} --json"), FLIGHTS)


def _network(name: str, text: str, teachers: tuple[str, ...], training: str, evaluation: str) -> Experiment:
    """A network that is trained for this experiment, and evaluated."""
    evaluate = f"policy evaluate {{runs}}/policy.onnx {evaluation} --json"
    return Experiment(name, text, teachers, (f"policy train {training} --out {{runs}}", evaluate))


_IMITATION = (
    "--recipe vision --stage state --set budget=0.15 --set env.count=4096 --set env.speed=[0.0,2.5] "
    "--set env.oscillating=0.0 --set env.hard_examples=0.0"  # or steep splines would be among a family's boards
)
LEARNED = {
    "perchrl": ("PerchRL", (VISION,), _IMITATION),
    "perchrl-without-ta": ("PerchRL w/o TA", (VISION,), f"{_IMITATION} --set network.temporal=false"),
    "incline-lander": ("InclineLander", (), "--recipe incline-lander --set budget=0.1"),
}
"""What learns, with 4 million samples -> what it is called, its teachers, and how it is trained."""


def _of_family(method: str, family: str) -> Experiment:
    """The paper's figure of trajectories: a network of its own for each."""
    title, teachers, training = LEARNED[method]
    odds = ",".join(str(float(k == MOTIONS[family])) for k in range(6))
    return _network(
        f"{method}-{family}",
        f"{title}, trained on {family} only: its motions",
        teachers,
        f"{training} --set env.families=[{odds}]",
        "--episodes 800 --motions",
    )


ABLATIONS = {
    "full": ("PerchRL", ""),
    "without-rho": ("without rho", "--set env.rho=false"),
    "augmentation": ("augmentation only", "--set weights.beta=0.0 --set weights.gamma=0.0"),
    "active": ("active perception only", "--set env.augmentation=false"),
    "none": ("neither", "--set env.augmentation=false --set weights.beta=0.0 --set weights.gamma=0.0"),
}
"""Variant of the paper's vision ablations -> what it is called, and what it changes."""


def _ablation(variant: str) -> Experiment:
    title, changes = ABLATIONS[variant]
    parent = f"--parent policies/checkpoints/{PARENT}"
    train = f"policy train --recipe ablation --stage vision {parent} {changes} --out {{runs}} --json"
    return Experiment(f"ablation-{variant}", f"vision ablation, {title}: its curve", (PARENT,), (train,))


EXPERIMENTS = (
    Experiment(
        "vision-published",
        "vision on the published noise: points, motions, map",
        (VISION,),
        ("policy evaluate vision --motions --heatmap {results}/vision-map.svg --json",),
    ),
    Experiment(
        "vision-measured",
        "vision on the measured noise: points, other vehicles and cameras",
        (VISION,),
        ("policy evaluate vision --noise measured --robust --json",),
    ),
    Experiment(
        "state",
        "state, told where the board is: points, motions, other vehicles, map",
        (STATE,),
        ("policy evaluate state --motions --robust --heatmap {results}/state-map.svg --json",),
    ),
    Experiment(
        "planner-published",
        "planner on the published noise: points, motions",
        (PREDICTOR,),
        ("policy evaluate planner --motions --json",),
    ),
    Experiment(
        "planner-measured",
        "planner on the measured noise",
        (PREDICTOR,),
        ("policy evaluate planner --noise measured --json",),
    ),
    Experiment(
        "fast-perching",
        "Fast-Perching, told where the board is: points, motions",
        (),
        ("policy evaluate fast-perching --episodes 200 --motions --json",),
    ),
    Experiment(
        "fast-perching-ctrv",
        "Fast-Perching that keeps the board's turn rate: points, motions",
        (),
        ("policy evaluate fast-perching-ctrv --episodes 200 --motions --json",),
    ),
    _flights("scenarios-pictures", "six scenarios with pictures", (VISION,), "--policy vision --seeds 9300..9339"),
    _flights(
        "scenarios-published",
        "six scenarios on the published noise",
        (PREDICTOR, VISION),
        "--policy vision --policy planner --camera model --seeds 9300..9319",
    ),
    *(_of_family(method, family) for method in LEARNED for family in MOTIONS),
    *(_ablation(variant) for variant in ABLATIONS),
    _network(
        "vision-to-2.5",
        "the recipe `vision` on the paper's range of speeds, to 2.5 m/s: points",
        (VISION,),
        "--stage vision --set env.speed=[0.0,2.5] --set env.oscillating=0.0 --set env.hard_examples=0.0",
        "",
    ),
)
"""Seeds 9300 and above were used for nothing before: no setting was chosen on them."""
