"""A rig: which link fills each slot, with which delays. Swapping simulated for real is one line of its TOML file."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from hil.contract.topics import Knows
from hil.safety.limits import CarGateLimits, GateLimits
from hil.wires import WireError
from hil.wires.crazyradio import check_radio
from hil.wires.simulator import check_simulator
from hil.wires.url import check_url
from kernel.toml_errors import ConfigError, load_toml, nearest
from scenarios.spec import Scenario
from vehicle.camera.lens import MODELS, Lens
from vehicle.quadrotor.airframe import load_airframe

RIG_DIR = Path(__file__).parent / "rigs"


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class VehicleSlot(_Section):
    """The quadrotor's autopilot: PX4, or a Crazyflie (crazyflie-sim, crazyflie). Of kind hitl it is a real firmware
    that flies our simulated vehicle. While motion capture or camera are simulated, the own estimate of a real vehicle
    stands for its true pose in what they see."""

    kind: Literal["sim", "mavlink", "hitl", "crazyflie-sim", "crazyflie"] = "sim"
    url: str = Field(
        default="",
        description="offboard link: udp://:14540 (listens), tcp://HOST:PORT, serial:///dev/ttyACM0; of a crazyflie "
        "radio://0/80/2M/E7E7E7E7E7 or udp://HOST:19850",
    )
    ground_url: str = Field(default="", description="ground station's link, for checklist and log: udp://:14550, ...")
    log_limit_s: float = Field(
        default=120.0, ge=0, le=7200,
        description="fetching a real autopilot's own log after a live flight is given up beyond it; 0: never fetched",
    )  # fmt: skip
    simulator: str = Field(
        default="", description="of kind hitl: tcp://:4560 (a SITL joins there), serial:///dev/ttyACM0 (a controller)"
    )
    px4: str = Field(
        default="",
        description="of kind hitl over TCP: build folder of the SITL that a run starts; empty: yours runs",
    )
    deterministic: bool = Field(
        default=False,
        description="two runs of a SITL that they start are equal: it gets a core of its own (in lockstep, as root)",
    )
    powered: bool = Field(
        default=False, description="of kind hitl over a serial port: the motors' battery may be connected"
    )
    system: int = Field(default=1, ge=1, le=255, description="MAV_SYS_ID of a real autopilot")
    component: int = Field(default=1, ge=1, le=255, description="MAV_COMP_ID of a real autopilot")
    airframe: str = "paper_quad"
    clock_drift: float = Field(default=1e-4, gt=0, le=0.1, description="of the autopilot's clock; a SITL needs 0.03")
    signing_key: str = Field(
        default="", description="file with the 32 bytes of a MAVLink 2 signing key; empty: unsigned"
    )
    wire_delay_ms: float = Field(default=1.0, ge=0, le=100, description="one way, each direction; in lockstep")
    external_pose: bool = Field(
        default=False, description="motion capture is fed into the autopilot's estimator, which has nothing else"
    )
    hover_position: float = Field(default=0.15, gt=0, le=2, description="m from the start that still is the hover")
    hover_speed: float = Field(default=0.08, gt=0, le=2, description="m/s; on GPS alone a vehicle never is as still")
    hover_turning: float = Field(default=0.15, gt=0, le=2, description="rad/s, of the same")

    @field_validator("simulator")
    @classmethod
    def _joinable(cls, value: str) -> str:
        if value:
            try:
                check_simulator(value)
            except WireError as error:
                raise ValueError(str(error)) from None
        return value

    @field_validator("url", "ground_url")
    @classmethod
    def _readable(cls, value: str) -> str:
        if value:
            try:
                (check_radio if value.startswith("radio:") else check_url)(value)
            except WireError as error:
                raise ValueError(str(error)) from None
        return value

    @model_validator(mode="after")
    def _reachable(self) -> VehicleSlot:
        if self.kind != "hitl" and (self.kind in ("mavlink", "crazyflie")) != bool(self.url):
            raise ValueError('kind "mavlink" needs a url and so does "crazyflie", kind "sim" has none')
        if self.url.startswith("radio:") != (self.kind == "crazyflie" and not self.url.startswith("udp:")):
            raise ValueError(
                f'"{self.url}": radio:// is the address of kind "crazyflie", which has udp://HOST:PORT else'
            )
        if self.kind.startswith("crazyflie") and not self.external_pose:
            raise ValueError("a Crazyflie knows where it is by motion capture only: set external_pose = true")
        if (self.kind == "hitl") != bool(self.simulator):
            raise ValueError('kind "hitl" needs a simulator (tcp://:4560 or serial:///dev/ttyACM0), others have none')
        if self.ground_url and self.kind == "sim":
            raise ValueError("ground_url is a link of a real autopilot")
        if self.deterministic and (self.kind != "hitl" or self.on_hardware):
            raise ValueError('deterministic is for kind "hitl" with a simulator of tcp://:4560')
        if self.px4 and (self.kind != "hitl" or self.on_hardware):
            raise ValueError('px4 is a build folder: only kind "hitl" with a simulator of tcp://:4560 has one')
        if self.powered and not self.on_hardware:
            raise ValueError('powered speaks of a flight controller: kind "hitl" with a serial simulator')
        if self.on_hardware and not self.url:
            raise ValueError("a flight controller needs a url as well: its offboard link, on another port")
        return self

    @property
    def on_hardware(self) -> bool:
        """Whether a flight controller flies our simulated vehicle."""
        return self.simulator.startswith("serial:")

    @property
    def simulated(self) -> bool:
        """Whether no real device is behind it: a firmware in lockstep is a process of this machine."""
        return self.kind in ("sim", "crazyflie-sim") or (self.kind == "hitl" and not self.on_hardware)

    @property
    def ours(self) -> bool:
        """Whether the vehicle's body is our plant, whatever its autopilot is."""
        return self.kind in ("sim", "hitl", "crazyflie-sim")


class GroundcarSlot(_Section):
    """The car under the board. `interface` and `channel` are python-can's, for kind can. While motion capture or camera
    are simulated, they see a real car where its wheel odometry puts it, from the scenario's start on."""

    kind: Literal["sim", "can"] = "sim"
    interface: Literal["socketcan", "udp_multicast", "virtual"] = "socketcan"
    channel: str = "can0"
    wire_delay_ms: float = Field(default=1.0, ge=0, le=100, description="one way, each direction; in lockstep")


class Calibration(_Section):
    """A camera's, as `perch-hil camera calibrate` and OpenCV give it: px, pixel centres at integers.

    Pictures stay as the lens takes them; the corners that are found in them are undistorted. A simulated camera is
    drawn with this lens. The defaults are the paper's ideal camera.
    """

    width: int = Field(default=1280, ge=160, le=4096)
    height: int = Field(default=720, ge=120, le=4096)
    fx: float = Field(default=723.9, gt=0)
    fy: float = Field(default=723.6, gt=0)
    cx: float = 639.5
    cy: float = 359.5
    model: Literal["none", "pinhole", "rational", "fisheye"] = Field(
        default="pinhole", description="of the distortion: none, or as OpenCV names and orders its coefficients"
    )
    distortion: tuple[float, ...] = Field(
        default=(), description="pinhole k1 k2 p1 p2 k3; rational also k4 k5 k6; fisheye k1 k2 k3 k4; empty: all 0"
    )

    @model_validator(mode="after")
    def _complete(self) -> Calibration:
        self.lens  # noqa: B018  raises where the coefficients do not suit the model
        return self

    @property
    def lens(self) -> Lens:
        """The distortion."""
        return Lens(self.model, self.distortion or (0.0,) * MODELS[self.model])


class CameraSlot(_Section):
    """The camera; `pictures` are rendered and detected, `model` is the paper's visibility gate and noise.

    `device`: /dev/video0 of kind v4l2; of kind gstreamer a pipeline without its sink ("v4l2src ! jpegdec"); a run's
    folder or recording, made with all pictures, of kind mcap, which is played back once the car sets off.
    """

    kind: Literal["sim", "v4l2", "gstreamer", "mcap"] = "sim"
    device: str = ""
    source: Literal["pictures", "model"] = "pictures"
    exposure_ms: float = Field(default=2.0, gt=0, le=30)
    transport_ms: float = Field(default=15.0, ge=0, le=200, description="read-out and transfer, after exposure")
    gain: float = Field(default=1.0, gt=0, le=4)
    pixel_format: str = Field(default="MJPG", pattern="^[A-Z0-9 ]{4}$", description="of kind v4l2: MJPG, GREY, YUYV")
    stamps: Literal["driver", "arrival"] = Field(
        default="driver",
        description="of kind v4l2: the buffer's stamp, or arrival less half exposure and transport",
    )
    stamp_offset_ms: float = Field(
        default=0.0, ge=-100, le=100, description="from the driver's stamp to the middle of the exposure; measure it"
    )
    calibration: Calibration = Calibration()
    model_processing_ms: float = Field(default=8.0, ge=0, le=200, description="detection time, with source = model")
    model_noise: Literal["paper", "measured"] = "paper"

    @model_validator(mode="after")
    def _complete(self) -> CameraSlot:
        if (self.kind != "sim") != bool(self.device):
            raise ValueError(f'kind "{self.kind}" {"needs a device" if self.kind != "sim" else "has no device"}')
        if self.kind != "sim" and self.source == "model":
            raise ValueError('source "model" stands for a camera that is simulated')
        return self


class MocapSlot(_Section):
    """The motion capture system: the referee's and the car's, never the policy's.

    Of kind vrpn: the server's HOST or HOST:PORT, and how it calls the two bodies, which are defined there as the
    vehicle's body (x forward, z up, at the centre of mass) and the board (x up the slope, z out of it, at its centre),
    in a world with z up. `delay_ms` is then taken off the arrival."""

    kind: Literal["sim", "vrpn"] = "sim"
    server: str = ""
    vehicle_body: str = "vehicle"
    board_body: str = "board"
    rate_hz: float = Field(default=100.0, gt=0, le=400)
    delay_ms: float = Field(default=5.0, ge=0, le=100)

    @model_validator(mode="after")
    def _complete(self) -> MocapSlot:
        if (self.kind == "vrpn") != bool(self.server):
            raise ValueError('kind "vrpn" needs a server, kind "sim" has none')
        return self


class PolicySlot(_Section):
    """What flies: `vision` (the network that comes with the project), `planner`, or the path of an ONNX file with the
    contract of `policies/flying/contract.py`."""

    kind: str = "vision"
    knows: Knows = Field(
        default="camera", description="by what it may know of the board: camera, or mocap (state-based flight)"
    )
    guidance: bool = Field(
        default=True, description="the laws of the last half second act on its commands; a network must want them"
    )


class Rig(_Section):
    """One rig file."""

    title: str
    preflight: str = Field(
        default="preflight", description="the checklist whose go lets it arm: preflight, crazyflie, or your own .toml"
    )
    crew_keys: tuple[str, ...] = Field(default=(), description="public keys (PEM, Ed25519): a go must be signed by one")
    vehicle: VehicleSlot = VehicleSlot()
    groundcar: GroundcarSlot = GroundcarSlot()
    camera: CameraSlot = CameraSlot()
    mocap: MocapSlot = MocapSlot()
    policy: PolicySlot = PolicySlot()
    gate: GateLimits = GateLimits()
    car_gate: CarGateLimits = CarGateLimits()

    @model_validator(mode="after")
    def _measured_from_outside(self) -> Rig:
        if self.vehicle.external_pose and not self.vehicle.ours and self.mocap.kind == "sim":
            raise ValueError(
                "vehicle.external_pose with a simulated motion capture would feed the autopilot its own estimate: "
                'use mocap of kind "vrpn", or leave external_pose out'
            )
        return self

    @property
    def simulated(self) -> bool:
        """True if no real device is in it (recorded pictures are none); such runs never share an identity with real
        ones."""
        others = all(slot.kind == "sim" for slot in (self.groundcar, self.mocap))
        return others and self.vehicle.simulated and self.camera.kind in ("sim", "mcap")


def list_rigs() -> list[str]:
    """Names of the rigs that come with the project."""
    return sorted(path.stem for path in RIG_DIR.glob("*.toml"))


def chosen_rig(scenario: Scenario, asked: str | None) -> str:
    """Name or path of the rig that flies `scenario`: the one asked for, or else the one that the scenario names."""
    return asked or scenario.rig


def load_rig(name: str) -> Rig:
    """The rig of that name, or the TOML file at that path. Raises ConfigError naming file, key and what is allowed."""
    path = Path(name)
    if path.suffix != ".toml":
        path = RIG_DIR / f"{name}.toml"
        if not path.exists():
            raise ConfigError(
                f'there is no rig "{name}"{nearest(name, list_rigs())} Known: {", ".join(list_rigs())}; '
                "a file of your own is given by its path, ending in .toml"
            )
    rig = load_toml(path, Rig)
    try:
        load_airframe(rig.vehicle.airframe)
    except ValueError as error:
        raise ConfigError(f'{path}: key "vehicle.airframe": {error}') from None
    return rig
