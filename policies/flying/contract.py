"""The contract of an ONNX policy, which the file's metadata carry, and its check before the flight.

A policy trained on another observation layout, action scaling, airframe or camera gives plausible numbers and flies
badly; a mismatch must therefore be one clear error before take-off.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from policies.task.observation import HISTORY, LAYOUT_NAME, LAYOUT_VERSION, OBS_DIM
from vehicle.quadrotor.airframe import Airframe

METADATA_KEY = "perch_hil_contract"
_RETRAIN = "; train it with this version of the project"
_STAGES = {
    "vision": ": it knows of the board by a camera; train one with --stage vision",
    "state": ": it knows of the board by motion capture; train one with --stage state, or fly a planner",
}
_ANOTHER_CAMERA = "; correct the calibration or the mount, train one for this mount, or fly a planner"
# How far a rig's camera may differ from the one trained with. Training turns the camera by up to 5 deg each way
# (`camera_tilt_deg` of policies/environment/config.py) and evaluation by up to 8; nothing varies the other two: so much
# a careful measurement, or another sample of the same lens, may differ.
EDGE = math.radians(5.0)  # of each edge of the picture, rad
FOCAL = 1.15  # ratio of the focal lengths in px, which decides from how far tags are read
OFFSET = 0.03  # of the camera's place on the vehicle, m
CONTRACT_FORMAT = 1


class ContractError(ValueError):
    """A policy file that cannot be flown, with the reason in one line, whatever names the file holds."""

    def __init__(self, reason: str) -> None:
        super().__init__("".join(c if c.isprintable() else " " for c in reason))


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ObservationContract(_Part):
    """Which vector the network reads: layout by name and version, `history` entries every `stride` control steps."""

    layout: str = LAYOUT_NAME
    version: int = LAYOUT_VERSION
    history: int = HISTORY
    stride: int = Field(default=3, ge=1, le=10)
    dimension: int = OBS_DIM


class ActionContract(_Part):
    """Paper Eq. of the CTBR action: output in [-1, 1], order roll, pitch, yaw rate, thrust. m/s^2 and rad/s."""

    thrust_min: float
    thrust_max: float
    rate_max: float

    @classmethod
    def of(cls, airframe: Airframe) -> ActionContract:
        """The command limits of `airframe`."""
        low, high = airframe.command.thrust
        return cls(thrust_min=low, thrust_max=high, rate_max=airframe.command.body_rate)


class VehicleContract(_Part):
    """The vehicle's properties that decide on a contact: the contact disc under the centre of mass, m, and the lags of
    thrust and body rate, s."""

    disc_below: float
    disc_radius: float
    thrust_lag: float
    rate_lag: float

    @classmethod
    def of(cls, airframe: Airframe) -> VehicleContract:
        """The values of `airframe`."""
        disc, lags = airframe.contact, (airframe.motors.lag, airframe.command.rate_lag)
        return cls(
            disc_below=disc.magnet_below, disc_radius=disc.footprint_radius, thrust_lag=lags[0], rate_lag=lags[1]
        )


class CameraContract(_Part):
    """The camera trained with, or a rig's: px (undistorted, pixel centres at integers), m (body FLU), rad below body
    x."""

    width: int = 1280
    height: int = 720
    fx: float = 723.9
    fy: float = 723.6
    cx: float = 639.5
    cy: float = 359.5
    offset: tuple[float, float, float] = (0.08, 0.0, 0.0)
    tilt: float = 0.2617993877991494

    @classmethod
    def of(cls, airframe: Airframe) -> CameraContract:
        """The paper's camera, with which the training environment sees, where the airframe carries it."""
        return cls(offset=airframe.camera.offset, tilt=math.radians(airframe.camera.tilt_deg))

    def edges(self) -> dict[str, float]:
        """Directions of the picture's edges, rad from body x: to the left, to the right, up and down."""
        return {
            "left": math.atan2(self.cx + 0.5, self.fx),
            "right": math.atan2(self.width - 0.5 - self.cx, self.fx),
            "upper": math.atan2(self.cy + 0.5, self.fy) - self.tilt,
            "lower": math.atan2(self.height - 0.5 - self.cy, self.fy) + self.tilt,
        }

    def difference(self, rig: CameraContract) -> str:
        """What tells it from the camera of a rig, as text; empty if they are so alike that a policy made with one may
        fly with the other (EDGE, OFFSET, FOCAL)."""
        for name, angle in self.edges().items():
            theirs = rig.edges()[name]
            if not abs(angle - theirs) <= EDGE:
                seen = f"a picture whose {name} edge is at {math.degrees(angle):.1f} deg"
                return f"{seen}, this rig's is at {math.degrees(theirs):.1f} deg"
        if not 1.0 / FOCAL <= self.fx / rig.fx <= FOCAL:
            return f"a focal length of {self.fx:.0f} px, this rig's is {rig.fx:.0f} px"
        if not math.dist(self.offset, rig.offset) <= OFFSET:
            return f"a camera at {self.offset} m from the centre of mass, this rig's is at {rig.offset} m"
        return ""


class Provenance(_Part):
    """Where the weights come from: enough to train them again."""

    recipe: str
    seed: int
    samples: int = Field(ge=0, description="environment steps trained on, ancestors included")
    commit: str = "unknown"
    parent: str = ""
    note: str = ""


class Contract(_Part):
    """Everything a flight must agree with.

    Normalisation (x - shift) / scale is applied inside the graph: one number for each entry of a history element, then
    for each of the tail; listed here so that the units can be checked.
    """

    format: Literal[1] = CONTRACT_FORMAT
    name: str
    stage: Literal["state", "vision"]
    control_hz: int = 100
    airframe: str
    observation: ObservationContract = ObservationContract()
    action: ActionContract
    camera: CameraContract
    vehicle: VehicleContract | None = Field(default=None, description="absent in older files")
    guidance: bool = Field(default=False, description="fly it with guidance outside; older files have it inside")
    provenance: Provenance
    shift: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()

    @classmethod
    def of(cls, airframe: Airframe, **others: Any) -> Contract:
        """A contract with the airframe's limits, contact disc, lags and camera; `others`: the rest of the fields."""
        parts = ActionContract.of(airframe), CameraContract.of(airframe), VehicleContract.of(airframe)
        return cls(airframe=airframe.name, action=parts[0], camera=parts[1], vehicle=parts[2], **others)


def parse_contract(text: str, where: str = "policy") -> Contract:
    """Contract from its JSON. Raises ContractError naming the first field that is wrong."""
    try:
        return Contract.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "contract"
        raise ContractError(
            f"{where}: contract field '{field}': {first['msg']}; export it again with this version"
        ) from None


def check_contract(
    contract: Contract,
    *,
    airframe: Airframe | None = None,
    camera: CameraContract | None = None,
    stage: str | None = None,
) -> None:
    """Raise ContractError, naming policy's and expected value, unless the policy fits this build and this flight.

    `camera`: as the rig has it, by default the training environment's on that airframe; `stage`: how the flight knows
    of the board.
    """
    here = ObservationContract(stride=contract.observation.stride)
    _same(contract, "observation layout", contract.observation.layout, here.layout)
    _same(contract, "observation version", contract.observation.version, here.version, _RETRAIN)
    _same(contract, "observation history", contract.observation.history, here.history)
    _same(contract, "observation dimension", contract.observation.dimension, here.dimension)
    _same(contract, "control rate in Hz", contract.control_hz, 100)
    if stage is not None:
        _same(contract, "stage", contract.stage, stage, _STAGES.get(stage, ""))
    if airframe is None:
        return
    stage = stage or contract.stage
    command = (
        f"perch-hil policy train --recipe airframe --stage {stage} --airframe {airframe.name} "
        f"--parent policies/checkpoints/plain/{stage}.onnx"
    )
    train = f"; train one for it: `{command}` (docs/train.md)"
    _same(contract, "airframe", contract.airframe, airframe.name, train)
    _same(contract, "action scaling", contract.action, ActionContract.of(airframe), train)
    if contract.vehicle is not None:
        _same(contract, "contact disc and lags", contract.vehicle, VehicleContract.of(airframe), train)
    difference = contract.camera.difference(camera or CameraContract.of(airframe))
    if contract.stage == "vision" and difference:
        raise ContractError(f"policy '{contract.name}' was made for {difference}{_ANOTHER_CAMERA}")


def _same(contract: Contract, what: str, has: object, wanted: object, mend: str = "") -> None:
    if has != wanted:
        raise ContractError(f"policy '{contract.name}' was made for {what} {has}, this flight has {wanted}{mend}")
