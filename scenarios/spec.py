"""The schema of a scenario file, and how it is found and read.

A scenario defines the board's path and speed law, the board, the start, the camera's rate, wind, limits and
tolerances, and the published row to compare with. It is data only: nothing here builds a path or a node.
SI units; a unit stands in a name only where it is not SI. World ENU; the path frame's origin is the world's.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from kernel.toml_errors import ConfigError, load_toml, nearest, read_toml
from scenarios.board_laws import HeightLaw, InclinationLaw, RecordedLaw
from scenarios.faults import FaultTable
from scenarios.paper import RealRow, SimulatedRow, published, row_keys
from scenarios.paths import (
    ArcPath,
    ConstantSpeed,
    CosineSpeed,
    Figure8Path,
    LinePath,
    OuSpeed,
    Path_,
    RacetrackPath,
    RecordedPath,
    RecordedSpeed,
    ScheduledSpeed,
    Speed,
    SplinePath,
    StaticPath,
)
from scenarios.table import NotNegative, Number, Positive, Range, Table

__all__ = [
    "ArcPath", "Board", "ConstantSpeed", "CosineSpeed", "Figure8Path", "LinePath", "OuSpeed", "RacetrackPath",
    "RecordedPath", "RecordedSpeed", "Scenario", "ScheduledSpeed", "SplinePath", "StaticPath", "Tolerance",
    "list_scenarios", "load", "published_row",
]  # fmt: skip

FOLDER = Path(__file__).parent


def _as_made(value: float) -> float:
    if value != BOARD_SIZE:
        raise ValueError(
            f"the board's side is {BOARD_SIZE} m and cannot be {value} m: its tags, the contact rule and the policies "
            "are made for that board; leave the key out"
        )
    return value


BOARD_SIZE = 0.42  # m, of groundcar/board/layout.py


class Board(Table):
    """Square board of side `size`, centre `height` above the ground, tilted by `inclination_deg` (0: facing up).

    `inclination_law` and `height_law` move it about these, as the deck of a boat does.
    """

    inclination_deg: Annotated[Number, Field(ge=0, le=90)]
    height: Positive = 1.5
    size: Annotated[Number, AfterValidator(_as_made)] = BOARD_SIZE
    inclination_law: InclinationLaw | None = None
    height_law: HeightLaw | None = None


class Start(Table):
    """Where the vehicle hovers, in polar form about the board: horizontal `distance` behind it, `altitude` above its
    centre, `azimuth_deg` counter-clockwise from straight behind, seen from above. The seed draws from each range.

    `anchor`: the moment at which the board is at the centre of these coordinates, the car's start or the attempt's
    start (by its reference motion; the car then comes from behind the vehicle). `yaw` faces that board position or the
    car's heading.

    `depression_max_deg`: limit of the board centre's angle below the horizon, so that the board is in the camera's
    view. The paper redraws a start until the board is visible; here the distance is drawn from the range that the
    altitude leaves. The camera's view reaches 41 deg down, less the board's size and the mount's error.
    """

    distance: Range
    altitude: Range
    azimuth_deg: Range
    depression_max_deg: Annotated[Number, Field(ge=1, le=89)] = 33.0
    anchor: Literal["car_start", "attempt_start"] = "car_start"
    yaw: Literal["board", "heading"] = "board"

    @model_validator(mode="after")
    def _visible(self) -> Start:
        nearest = self.nearest(self.altitude[1])
        if nearest > self.distance[1]:
            raise ValueError(
                f"at altitude {self.altitude[1]} m the board would be more than {self.depression_max_deg:g} deg below "
                f"the horizon: distance must reach at least {math.ceil(100 * nearest) / 100} m"
            )
        return self

    def nearest(self, altitude: float) -> float:
        """The least distance (m) that may be drawn at `altitude` (m)."""
        return max(self.distance[0], altitude / math.tan(math.radians(self.depression_max_deg)))


class Car(Table):
    """The car starts `lead` s before the attempt, that is before the policy may engage."""

    lead: NotNegative = 0.0


class Camera(Table):
    """`rate`: exposures a second."""

    rate: Annotated[Number, Field(ge=1, le=240)]


class Wind(Table):
    """Mean wind (world, the velocity of the air), gusts of one-sigma `gust` per axis with correlation `gust_time`."""

    mean: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    gust: NotNegative = 0.0
    gust_time: Positive = 1.0


class Tolerance(Table):
    """A perch counts within tolerance if all three hold at contact (paper, Algorithm 1)."""

    distance: Positive = 0.2
    tangential_speed: Positive = 0.6
    angle: Positive = 0.2


class Attachment(Table):
    """What holds the vehicle on the board, and within which limits at contact: rad, m/s along the board, m/s into it.

    No limits are published. The defaults are a small pot magnet's on a sheet of steel, see policies/task/contact.py.
    """

    normal_error: Positive = 0.35
    tangential_speed: Positive = 0.8
    impact_speed: Range = (0.05, 1.5)


class Workspace(Table):
    """The box the vehicle must stay in from hand-over to the end, in the world frame (z from the ground)."""

    x: Range = (-20.0, 20.0)
    y: Range = (-20.0, 20.0)
    z: Range = (0.3, 8.0)


class Randomisation(Table):
    """What a seed draws: relative half-widths and half-widths of uniform draws (paper, domain randomisation).

    `camera_calibration_deg` is the one-sigma part of the mount's tilt that a calibration leaves unknown (0.5 deg is
    0.02 m at 2 m, the paper's position bias); the biases are one-sigma and act where pictures are not rendered. `drag`
    is not in the paper, whose equations have none; it is wide because drag is rarely measured.
    """

    mass: Annotated[Number, Field(ge=0, lt=1)] = 0.30
    inertia: Annotated[Number, Field(ge=0, lt=1)] = 0.10
    thrust_to_weight: Annotated[Number, Field(ge=0, lt=1)] = 0.15
    thrust_gain: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    drag: Annotated[Number, Field(ge=0, le=1)] = 1.0
    camera_tilt_deg: NotNegative = 5.0
    camera_calibration_deg: NotNegative = 0.5
    vision_position_bias: NotNegative = 0.02
    vision_orientation_bias_deg: NotNegative = 2.0


class Scenario(Table):
    """One scenario file. `time_limit` (s) counts from the attempt's start; `published` names a row of paper.toml.

    `rig`: what flies it unless another is asked for.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$", max_length=40)]
    title: str
    description: str
    path: Path_
    speed: Speed
    board: Board
    start: Start
    camera: Camera
    car: Car = Car()
    wind: Wind = Wind()
    tolerance: Tolerance = Tolerance()
    attachment: Attachment = Attachment()
    workspace: Workspace = Workspace()
    randomisation: Randomisation = Randomisation()
    time_limit: Positive = 15.0
    published: str | None = None
    rig: str = "sim"
    fault: tuple[FaultTable, ...] = ()

    @property
    def tilts(self) -> bool:
        """Whether the board's inclination or height changes during a run."""
        laws = (self.board.inclination_law, self.board.height_law)
        return any(law is not None for law in laws) or any(one.kind.startswith("board.") for one in self.fault)

    @model_validator(mode="after")
    def _fits(self) -> Scenario:
        recorded = isinstance(self.path, RecordedPath)
        if recorded != isinstance(self.speed, RecordedSpeed):
            raise ValueError('path.kind "recorded" and speed.kind "recorded" need each other')
        change = isinstance(self.path, SplinePath) and self.path.then is not None
        if isinstance(self.speed, ScheduledSpeed) and not change:
            raise ValueError('speed.kind "scheduled" changes speed when the path does: add a [path.then] table')
        if isinstance(self.path, StaticPath) and getattr(self.speed, "speed", 1.0) != 0.0:
            raise ValueError('path.kind "static" needs speed.kind "constant" with speed = 0')
        laws = (self.board.inclination_law, self.board.height_law)
        if any(isinstance(law, RecordedLaw) for law in laws) and not recorded:
            raise ValueError('a law of kind "recorded" needs path.kind "recorded"')
        return self


def list_scenarios() -> list[str]:
    """Names of the scenarios that come with the project, easiest first as in the paper."""
    files = (p for p in FOLDER.glob("*.toml") if "path" in read_toml(p))
    order = {"simple": 0, "normal": 1, "hard": 2}
    names = (p.stem.replace("_", "-") for p in files)
    return sorted(names, key=lambda n: (order.get(n.split("-")[0], 3), n))


def load(name_or_path: str | Path) -> Scenario:
    """The scenario called `name_or_path`, or the user's own file if that is a path.

    Raises ConfigError (a ValueError) for an unknown name, with the nearest one, and for every fault in the file.
    """
    text = str(name_or_path)
    if text.endswith(".toml") or "/" in text:
        return _checked(Path(text))
    names = list_scenarios()
    name = text.lower().replace("_", "-")
    if name not in names:
        raise ConfigError(
            f'there is no scenario "{text}"{nearest(name, names)} Known: {", ".join(names)}; '
            "a file of your own is given by its path, ending in .toml"
        )
    return _checked(FOLDER / f"{name.replace('-', '_')}.toml")


def _checked(path: Path) -> Scenario:
    scenario = load_toml(path, Scenario)
    if scenario.published is not None and scenario.published not in row_keys():
        keys = row_keys()
        raise ConfigError(
            f'{path}: key "published" is "{scenario.published}"{nearest(scenario.published, keys)} '
            f"Allowed: {', '.join(keys)}, or leave the key out"
        )
    return scenario


def published_row(scenario: Scenario) -> RealRow | SimulatedRow | None:
    """The published row that the scenario compares with, or None."""
    return published(scenario.published) if scenario.published else None
