"""The policies that fly by name: the networks that come with the project, and the planners."""

from __future__ import annotations

from pathlib import Path

SHIPPED = ("vision", "state")  # for the belief from a camera; for the board's pose from motion capture
PLANNERS = ("planner", "planner-analytic")  # it predicts the board by a network; by equations
FLYABLE = (*SHIPPED, *PLANNERS)
_FOLDER = Path(__file__).parents[1] / "checkpoints"


def policy_data(policy: str) -> dict[str, Path]:
    """What flies beside the code and `policy_file`: name of its part -> file."""
    return {"predictor": _FOLDER / "predictor.npz"} if policy == "planner" else {}


def policy_file(policy: str) -> Path | None:
    """The file behind `policy`, a shipped network's name or a path; None if it has none, as the planners."""
    if policy in SHIPPED:
        return _FOLDER / f"{policy}.onnx"
    return Path(policy) if Path(policy).suffix or "/" in policy else None
