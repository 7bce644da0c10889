"""Every message that crosses a topic: plain frozen data, SI units, world ENU, body FLU, quaternions w, x, y, z.

`stamp_ns` is the time at which the content was true (exposure time for anything seen by the camera), never the time it
was sent. Fields are only ever appended: `hil/contract/codec.py` numbers them in this order for the recording.
"""

from __future__ import annotations

from dataclasses import dataclass

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class VehicleState:
    """Pose and twist of the quadrotor's centre of mass: truth, motion capture or the autopilot's estimate, by topic."""

    stamp_ns: int
    position: Vec3  # m, world
    velocity: Vec3  # m/s, world
    orientation: Quat  # world from body
    body_rate: Vec3  # rad/s, body


@dataclass(frozen=True, slots=True)
class VehicleStatus:
    """What the autopilot reports of itself."""

    stamp_ns: int
    connected: bool
    armed: bool
    landed: bool
    failsafe: bool
    mode: str  # e.g. AUTO.LOITER, OFFBOARD
    phase: str  # of the driver: boot, arm, takeoff, goto, hover, handed_over, killed
    battery_v: float
    hover_thrust: float  # normalised 0..1, learned in hover; 0 while unknown


@dataclass(frozen=True, slots=True)
class VehicleParameters:
    """The autopilot's parameters that matter here, as it holds them once the driver has set its own."""

    stamp_ns: int
    names: tuple[str, ...]
    values: tuple[float, ...]  # in PX4's units, one a name


@dataclass(frozen=True, slots=True)
class BoardState:
    """Pose and motion of the board's centre: truth or motion capture, by topic."""

    stamp_ns: int
    position: Vec3  # m, world, board centre
    velocity: Vec3  # m/s, world
    orientation: Quat  # world from board: x up-slope (forward), y left, z the outward normal
    heading: float  # rad, of the car
    speed: float  # m/s, signed, along the heading
    turn_rate: float  # rad/s


@dataclass(frozen=True, slots=True)
class CarReference:
    """Where the follower wants the car to be now."""

    stamp_ns: int
    x: float
    y: float
    heading: float
    speed: float
    turn_rate: float


@dataclass(frozen=True, slots=True)
class CarCommand:
    """Forward speed (m/s) and turn rate (rad/s, counter-clockwise positive) asked of the car."""

    stamp_ns: int
    speed: float
    turn_rate: float


@dataclass(frozen=True, slots=True)
class CarFeedback:
    """What the car reports over CAN."""

    stamp_ns: int
    speed: float
    turn_rate: float
    mode: str  # standby, can, uart, rc
    battery_v: float
    fault: str  # empty while healthy
    rejected_frames: int


@dataclass(frozen=True, slots=True)
class Image:
    """A mono8 picture. `stamp_ns` is the middle of the exposure."""

    stamp_ns: int
    width: int
    height: int
    exposure_ns: int
    data: bytes
    sequence: int


@dataclass(frozen=True, slots=True)
class Detection:
    """The outcome of looking for the board in one picture; `found` False: it was looked for and not seen."""

    stamp_ns: int  # middle of the exposure
    found: bool
    position: Vec3  # m, world, board centre
    orientation: Quat  # world from board
    position_sigma: float  # m, predicted one-sigma
    orientation_sigma: float  # rad, predicted one-sigma
    tag_ids: tuple[int, ...]
    corners_px: tuple[float, ...]  # x, y of four corners per tag, OpenCV pixel convention
    reason: str  # why nothing was published, empty if found
    image_sequence: int
    processing_ns: int  # measured in live runs, modelled in lockstep


@dataclass(frozen=True, slots=True)
class Belief:
    """The filter's picture of the board at `stamp_ns` (predicted to now, not to the last exposure)."""

    stamp_ns: int
    valid: bool
    position: Vec3
    heading: float
    speed: float
    turn_rate: float
    inclination: float  # rad
    rho: float  # reliability, paper Sec. "Visibility-Aware Input Augmentation"
    last_exposure_ns: int  # of the newest accepted measurement
    accepted: int  # measurements so far
    rejected: int
    variance: tuple[float, ...]  # diagonal of the covariance, in the filter's state order
    acceleration: float  # m/s^2, along the heading
    streak: int  # measurements accepted since the filter last (re)started
    surface_sigma: float  # m, of the board's surface along its normal, at the newest accepted measurement


@dataclass(frozen=True, slots=True)
class Action:
    """What the policy asks of the vehicle: body rates and mass-normalised collective thrust (CTBR)."""

    stamp_ns: int
    engaged: bool  # False while the policy still waits for detections: the driver keeps its hover
    body_rate: Vec3  # rad/s, body FLU
    thrust: float  # m/s^2
    phase: str
    exposure_ns: int  # of the newest picture behind this action, for latency
    thrust_gain: float  # the policy's own estimate of achieved/asked thrust, 1 if it has none


@dataclass(frozen=True, slots=True)
class Sent:
    """What really went out to the autopilot after the gate."""

    stamp_ns: int
    body_rate: Vec3  # rad/s, body FLU
    thrust: float  # m/s^2
    thrust_normalised: float  # 0..1 on the wire
    limited: bool
    tripped: str  # empty, or why the gate latched


@dataclass(frozen=True, slots=True)
class Contact:
    """The referee's verdict: `outcome` is ongoing, success, fail (Algorithm 1); `attached`: the magnet held."""

    stamp_ns: int
    outcome: str
    reason: str
    attached: bool
    within_tolerance: bool
    x: float  # m, board frame
    y: float
    normal_error: float  # rad
    normal_speed: float  # m/s, negative into the board
    tangential_speed: float  # m/s


@dataclass(frozen=True, slots=True)
class Event:
    """Something a reader of the recording should not have to search for."""

    stamp_ns: int
    severity: str  # info, warning, error
    source: str
    text: str


@dataclass(frozen=True, slots=True)
class Stage:
    """Where the run stands: prepare (autopilot boots, takes off, flies to the start), lead (the car drives, the policy
    may not engage yet), attempt, ended."""

    stamp_ns: int
    name: str
    attempt_start_ns: int  # 0 until known
    car_start_ns: int  # 0 until known
