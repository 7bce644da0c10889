"""Paths and speed laws of the board, as a scenario file writes them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from scenarios.table import NotNegative, Number, Positive, Range, Table


class StaticPath(Table):
    """The board stands at (x, y) with heading `heading_deg` (counter-clockwise from east)."""

    kind: Literal["static"]
    x: Number = 0.0
    y: Number = 0.0
    heading_deg: Number = 0.0


class LinePath(Table):
    """Reciprocating line x = A sin(v t / A + phase), y = 0, constant heading, signed speed (paper, trajectory (a)).

    The speed law gives v, the peak speed. `phase_deg` -90 starts at the western turning point, at rest.
    """

    kind: Literal["line"]
    amplitude: Positive = 12.0
    phase_deg: Number = -90.0


class RacetrackPath(Table):
    """Two straights of `straight` joined by semicircles of `radius`, counter-clockwise (paper, trajectory (b))."""

    kind: Literal["racetrack"]
    radius: Positive = 4.0
    straight: Positive = 4.0
    lap_start: Range = (0.0, 1.0)


class Figure8Path(Table):
    """Lemniscate of scale `scale` (paper, trajectory (c))."""

    kind: Literal["figure8"]
    scale: Positive = 4.0
    lap_start: Range = (0.0, 1.0)


class ArcPath(Table):
    """A circle of `radius` about the origin, driven to the left (counter-clockwise) or to the right."""

    kind: Literal["arc"]
    radius: Positive
    turn: Literal["left", "right"] = "left"
    lap_start: Range = (0.0, 1.0)


class ThenArc(Table):
    """A tangential change to a circular arc, `after` s (drawn from [low, high]) after the car's start."""

    after: Range
    radius: Positive
    turn: Literal["left", "right"] = "left"


class SplinePath(Table):
    """Random periodic cubic B-spline about the origin (paper, trajectory (d)): control radii drawn by the seed from
    U(radius), smoothed around the circle, shrunk until curvature <= turn_rate_limit / speed."""

    kind: Literal["spline"]
    control_points: Annotated[int, Field(ge=4, le=1000)] = 12
    radius: Range = (1.0, 12.0)
    turn_rate_limit: Positive = 1.2
    lap_start: Range = (0.0, 1.0)
    then: ThenArc | None = None


class RecordedPath(Table):
    """The motion of a board that was recorded, from the moment at which its car set off.

    `file`: a run's folder, a recording (.mcap), or a .csv with the columns t (s), x, y (m) and heading (rad), and,
    if they are known, z (m), speed (m/s), turn_rate (rad/s), inclination (rad). `source`: what of a run is taken; "any"
    is motion capture if it has it, else the wheels. After its end the board goes on with its last speed and turn rate.
    `sha256`: of the file; a run is flown with this content and no other.
    """

    kind: Literal["recorded"]
    file: Annotated[str, Field(min_length=1)]
    source: Literal["any", "mocap", "truth", "wheels"] = "any"
    sha256: str = ""


Path_ = Annotated[
    StaticPath | LinePath | RacetrackPath | Figure8Path | ArcPath | SplinePath | RecordedPath,
    Field(discriminator="kind"),
]


class ConstantSpeed(Table):
    kind: Literal["constant"]
    speed: NotNegative


class OuSpeed(Table):
    """speed * exp(eta), eta an Ornstein-Uhlenbeck process (paper, appendix on trajectories)."""

    kind: Literal["ou"]
    speed: NotNegative
    tau: Positive = 1.0
    sigma: NotNegative = 0.1


class CosineSpeed(Table):
    """minimum + (maximum - minimum) (1 + cos(2 pi t / period + phase)) / 2, t from the car's start (paper, Hard-I).

    The seed draws the phase from `phase_deg`, [low, high].
    """

    kind: Literal["cosine"]
    minimum: NotNegative
    maximum: NotNegative
    period: Positive
    phase_deg: Range = (0.0, 0.0)

    @model_validator(mode="after")
    def _order(self) -> CosineSpeed:
        if self.minimum > self.maximum:
            raise ValueError(f"minimum {self.minimum} is above maximum {self.maximum}")
        return self


class ScheduledSpeed(Table):
    """`first` until the path's change (`path.then`), then within `ramp` seconds to `second` (paper, Hard-II)."""

    kind: Literal["scheduled"]
    first: NotNegative
    second: NotNegative
    ramp: NotNegative = 0.5


class RecordedSpeed(Table):
    """That of the recorded path."""

    kind: Literal["recorded"] = "recorded"


Speed = Annotated[ConstantSpeed | OuSpeed | CosineSpeed | ScheduledSpeed | RecordedSpeed, Field(discriminator="kind")]
