"""The policies that come with the project: networks and planners, and which of them fly by name."""

from __future__ import annotations

from pathlib import Path

# Networks, name -> file: of the paper's quadrotor by the stage that they are for, a camera's belief or the board's true
# state; of other airframes by their names: PX4's SIH quadrotor by a camera, the Crazyflie before a vertical board that
# motion capture knows.
SHIPPED = {
    "vision": "vision.onnx",
    "state": "state.onnx",
    "sih_quad": "airframes/sih_quad.onnx",
    "crazyflie": "airframes/crazyflie.onnx",
}
PLANNERS = ("planner", "planner-analytic")  # it predicts the board by a network; by equations
FLYABLE = ("vision", *PLANNERS, "sih_quad", "crazyflie")  # no rig knows of the board what `state` is told
CHECKPOINTS = Path(__file__).parents[1] / "checkpoints"


def policy_data(policy: str) -> dict[str, Path]:
    """What flies beside the code and `policy_file`: name of its part -> file."""
    return {"predictor": CHECKPOINTS / "predictor.npz"} if policy == "planner" else {}


def policy_file(policy: str) -> Path | None:
    """The file behind `policy`, a shipped network's name or a path; None if it has none, as the planners."""
    if policy in SHIPPED:
        return CHECKPOINTS / SHIPPED[policy]
    return Path(policy) if Path(policy).suffix or "/" in policy else None
