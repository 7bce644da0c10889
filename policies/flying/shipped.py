"""The policies that come with the project: networks and planners, and which of them fly by name."""

from __future__ import annotations

from pathlib import Path

SHIPPED = ("vision", "state")  # networks, by the stage that they are for: a camera's belief; the board's true state
PLANNERS = ("planner", "planner-analytic")  # it predicts the board by a network; by equations
FLYABLE = ("vision", *PLANNERS)  # what knows of the board by a camera, as every flight does
CHECKPOINTS = Path(__file__).parents[1] / "checkpoints"


def policy_data(policy: str) -> dict[str, Path]:
    """What flies beside the code and `policy_file`: name of its part -> file."""
    return {"predictor": CHECKPOINTS / "predictor.npz"} if policy == "planner" else {}


def policy_file(policy: str) -> Path | None:
    """The file behind `policy`, a shipped network's name or a path; None if it has none, as the planners."""
    if policy in SHIPPED:
        return CHECKPOINTS / f"{policy}.onnx"
    return Path(policy) if Path(policy).suffix or "/" in policy else None
