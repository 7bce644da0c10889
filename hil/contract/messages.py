"""Every message that crosses a topic: plain frozen data, SI units, world ENU, body FLU, quaternions w, x, y, z.

`stamp_ns` is the time at which the content was true (exposure time for anything seen by the camera), never the time it
was sent. Fields are only ever appended: `hil/contract/codec.py` numbers them in this order for the recording, and puts
what is said of a field here into the recording's schemas as its comment.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

Stamp = Annotated[int, "ns of the run's clock; when the content was true"]
Position = Annotated[Vec3, "m, world ENU: x east, y north, z up"]
Velocity = Annotated[Vec3, "m/s, world ENU"]
BodyRate = Annotated[Vec3, "rad/s, body FLU: about x forward, y left, z up"]
Heading = Annotated[float, "rad, counter-clockwise from east"]
Speed = Annotated[float, "m/s, along the heading, negative backwards"]
TurnRate = Annotated[float, "rad/s, counter-clockwise"]
BoardAttitude = Annotated[Quat, "w, x, y, z; world from board: x up-slope (forward), y left, z the outward normal"]


@dataclass(frozen=True, slots=True)
class VehicleState:
    """Pose and twist of the quadrotor's centre of mass: truth, motion capture or the autopilot's estimate, by topic."""

    stamp_ns: Stamp
    position: Position
    velocity: Velocity
    orientation: Annotated[Quat, "w, x, y, z; world ENU from body FLU"]
    body_rate: BodyRate


@dataclass(frozen=True, slots=True)
class VehicleStatus:
    """What the autopilot reports of itself."""

    stamp_ns: Stamp
    connected: Annotated[bool, "its heartbeats arrive"]
    armed: Annotated[bool, "by its own report"]
    landed: Annotated[bool, "by its own report"]
    failsafe: Annotated[bool, "a failsafe acts"]
    mode: Annotated[str, "e.g. AUTO.LOITER, OFFBOARD"]
    phase: Annotated[str, "of the driver: boot, arm, takeoff, goto, hover, handed_over, killed"]
    battery_v: Annotated[float, "V"]
    hover_thrust: Annotated[float, "1, normalised 0..1, learned in hover; 0 while unknown"]
    clock_offset_ns: Annotated[int, "ns, the autopilot's time less the run's clock, by TIMESYNC; 0 while unknown"] = 0

    @property
    def given_up(self) -> bool:
        """Whether the policy flies it no more: it brakes, or its autopilot or a pilot has it."""
        return self.phase in ("brake", "released", "interrupted", "failed")


@dataclass(frozen=True, slots=True)
class VehicleParameters:
    """The autopilot's parameters that matter here, as it holds them once the driver has set its own."""

    stamp_ns: Stamp
    names: Annotated[tuple[str, ...], "PX4's"]
    values: Annotated[tuple[float, ...], "in PX4's units, one a name"]


@dataclass(frozen=True, slots=True)
class BoardState:
    """Pose and motion of the board's centre: truth or motion capture, by topic."""

    stamp_ns: Stamp
    position: Annotated[Vec3, "m, world ENU; the board's centre"]
    velocity: Velocity
    orientation: BoardAttitude
    heading: Annotated[float, "rad, of the car, counter-clockwise from east"]
    speed: Speed
    turn_rate: TurnRate


@dataclass(frozen=True, slots=True)
class CarReference:
    """Where the follower wants the car to be now."""

    stamp_ns: Stamp
    x: Annotated[float, "m, world, east"]
    y: Annotated[float, "m, world, north"]
    heading: Heading
    speed: Speed
    turn_rate: TurnRate


@dataclass(frozen=True, slots=True)
class CarCommand:
    """Forward speed (m/s) and turn rate (rad/s, counter-clockwise positive) asked of the car."""

    stamp_ns: Stamp
    speed: Speed
    turn_rate: TurnRate


@dataclass(frozen=True, slots=True)
class CarFeedback:
    """What the car reports over CAN."""

    stamp_ns: Stamp
    speed: Speed
    turn_rate: TurnRate
    mode: Annotated[str, "standby, can, uart, rc"]
    battery_v: Annotated[float, "V"]
    fault: Annotated[str, "empty while healthy"]
    rejected_frames: Annotated[int, "so far"]


@dataclass(frozen=True, slots=True)
class Image:
    """A mono8 picture. `stamp_ns` is the middle of the exposure."""

    stamp_ns: Stamp
    width: Annotated[int, "px"]
    height: Annotated[int, "px"]
    exposure_ns: Annotated[int, "ns, how long"]
    data: Annotated[bytes, "mono8, row by row from the top"]
    sequence: Annotated[int, "number of the picture"]


@dataclass(frozen=True, slots=True)
class Detection:
    """The outcome of looking for the board in one picture; `found` False: it was looked for and not seen."""

    stamp_ns: Annotated[int, "ns of the run's clock; middle of the exposure"]
    found: Annotated[bool, "False: it was looked for and not seen"]
    position: Annotated[Vec3, "m, world ENU; the board's centre"]
    orientation: BoardAttitude
    position_sigma: Annotated[float, "m, predicted one-sigma"]
    orientation_sigma: Annotated[float, "rad, predicted one-sigma"]
    tag_ids: Annotated[tuple[int, ...], "of the tags found, family tag36h11"]
    corners_px: Annotated[
        tuple[float, ...], "px of the full picture: x, y of four corners per tag; the first pixel's centre is (0, 0)"
    ]
    reason: Annotated[str, "why nothing was published, empty if found"]
    image_sequence: Annotated[int, "number of the picture"]
    processing_ns: Annotated[int, "ns, measured in live runs, modelled in lockstep"]


@dataclass(frozen=True, slots=True)
class Belief:
    """The filter's picture of the board at `stamp_ns` (predicted to now, not to the last exposure)."""

    stamp_ns: Stamp
    valid: Annotated[bool, "False: there is no estimate, the rest means nothing"]
    position: Annotated[Vec3, "m, world ENU; the board's centre"]
    heading: Heading
    speed: Speed
    turn_rate: TurnRate
    inclination: Annotated[float, "rad, of the board against the ground"]
    rho: Annotated[float, "1, reliability, paper Sec. Visibility-Aware Input Augmentation"]
    last_exposure_ns: Annotated[int, "ns of the run's clock, of the newest accepted measurement; 0: none"]
    accepted: Annotated[int, "measurements accepted so far"]
    rejected: Annotated[int, "measurements rejected by the innovation test so far"]
    variance: Annotated[
        tuple[float, ...],
        "diagonal of the covariance, SI squared: x, y, z, heading, speed, turn rate, inclination, acceleration, bias",
    ]
    acceleration: Annotated[float, "m/s^2, along the heading"]
    streak: Annotated[int, "measurements accepted since the filter last (re)started"]
    surface_sigma: Annotated[float, "m, of the board's surface along its normal, at the newest accepted measurement"]


@dataclass(frozen=True, slots=True)
class Action:
    """What is asked of the vehicle: body rates and mass-normalised collective thrust (CTBR), and what the policy asked
    before guidance."""

    stamp_ns: Stamp
    engaged: Annotated[bool, "False while the policy still waits for detections: the driver keeps its hover"]
    body_rate: BodyRate
    thrust: Annotated[float, "m/s^2, mass-normalised collective thrust along body z"]
    phase: Annotated[str, "of the policy"]
    exposure_ns: Annotated[int, "ns of the run's clock, of the newest picture behind this action; 0: none"]
    thrust_gain: Annotated[float, "1, the policy's own estimate of achieved/asked thrust; 1 if it has none"]
    asked_rate: Annotated[Vec3, "rad/s, body FLU, asked by the policy before guidance"] = (0.0, 0.0, 0.0)
    asked_thrust: Annotated[float, "m/s^2, asked by the policy before guidance; 0: there was no guidance"] = 0.0
    laws: Annotated[int, "which laws of guidance acted: bits of policies/guidance/guide.py"] = 0


@dataclass(frozen=True, slots=True)
class Sent:
    """What really went out to the autopilot after the gate."""

    stamp_ns: Stamp
    body_rate: BodyRate
    thrust: Annotated[float, "m/s^2, mass-normalised collective thrust along body z"]
    thrust_normalised: Annotated[float, "1, 0..1 on the wire"]
    limited: Annotated[bool, "the gate changed it"]
    tripped: Annotated[str, "empty, or why the gate latched"]


@dataclass(frozen=True, slots=True)
class Contact:
    """The referee's verdict: `outcome` is ongoing, success, fail (Algorithm 1); `attached`: the magnet held."""

    stamp_ns: Stamp
    outcome: Annotated[str, "ongoing, success, fail (Algorithm 1)"]
    reason: Annotated[str, "why it failed, empty otherwise"]
    attached: Annotated[bool, "the magnet held"]
    within_tolerance: Annotated[bool, "the paper's tolerances were kept at contact"]
    x: Annotated[float, "m, board frame, up-slope; of the magnet at contact"]
    y: Annotated[float, "m, board frame, to the left"]
    normal_error: Annotated[float, "rad, between body z and the board's normal"]
    normal_speed: Annotated[float, "m/s, negative into the board"]
    tangential_speed: Annotated[float, "m/s, along the board"]


@dataclass(frozen=True, slots=True)
class Event:
    """Something a reader of the recording should not have to search for."""

    stamp_ns: Stamp
    severity: Annotated[str, "info, warning, error"]
    source: Annotated[str, "the node, or the host"]
    text: Annotated[str, "plain English"]


@dataclass(frozen=True, slots=True)
class Stage:
    """Where the run stands: prepare (autopilot boots, takes off, flies to the start), lead (the car drives, the policy
    may not engage yet), attempt, ended."""

    stamp_ns: Stamp
    name: Annotated[str, "prepare, lead, attempt, ended"]
    attempt_start_ns: Annotated[int, "ns of the run's clock; 0 until known"]
    car_start_ns: Annotated[int, "ns of the run's clock; 0 until known"]


@dataclass(frozen=True, slots=True)
class Faults:
    """Which of the scenario's faults act now, and which have begun so far."""

    stamp_ns: Stamp
    active: Annotated[tuple[int, ...], "places in the scenario, from 0, of those that act now"]
    begun: Annotated[tuple[int, ...], "places in the scenario, from 0, of those that have begun"]
