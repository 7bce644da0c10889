"""Guidance's parameters: a checked dataclass, their row for kernels, and the indices of that row.

Used as a namespace: `from policies.guidance import params as gp`, then `row[gp.RADIUS]`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from vehicle.quadrotor.airframe import Airframe

(
    BELOW, RADIUS, THRUST_MIN, THRUST_MAX, RATE_MAX, RATE_LAG, THRUST_LAG, SIGMA_LOW, SIGMA_HIGH, LEAN, LEAN_UNCERTAIN,
    BANK_SHARE, BANK_FROM, BANK_MOST, ALIGN_WITHIN, ALIGN_SHORTEST, ALIGN_BAND, ALIGN_SIGMAS, ALIGN_EARLIEST,
    ALIGN_CLOSING, ALIGN_COSINE, ALIGN_OFFSET, FLARE_RATE, FLARE_WITHIN, FLARE_SHORTEST, FLARE_CLOSING, FLARE_OFFSET,
    IMPACT_SPEED, IMPACT_WITHIN, IMPACT_TILT, IMPACT_MARGIN, IMPACT_SHORTEST, IMPACT_COSINE, IMPACT_OFFSET,
    SLIDING_LOW, SLIDING_HIGH,
) = range(36)  # fmt: skip
COUNT = 36
BY_STATE = {"lean": 0.04, "lean_uncertain": 0.0}  # of flight by motion capture, which knows every surface well
LEAN_SLOPE = 0.5  # sine of the inclination below which LEAN_UNCERTAIN is reduced in proportion


@dataclass(frozen=True)
class GuidanceParams:
    """Parameters of the three laws. Those without a default come from the airframe (`of`). SI units, rad."""

    # The airframe.
    below: float  # m, contact disc under the centre of mass
    radius: float  # m, of the contact disc
    thrust_min: float  # m/s^2, least collective thrust that may be asked
    thrust_max: float  # m/s^2, most collective thrust that may be asked
    rate_max: float  # rad/s, most body rate that may be asked about each axis
    rate_lag: float  # s, lag of the body rate behind its set-point
    thrust_lag: float  # s, lag of the motors' thrust
    flare_rate: float  # rad/s, mean rate that the rest of the turn needs at the last moment to begin it
    # How well the board's surface is known.
    sigma_low: float = 0.002  # m, sigma of the surface along its normal up to which it counts as well known
    sigma_high: float = 0.006  # m, sigma from which it counts as poorly known
    # The body z axis that is wanted at contact.
    lean: float = 0.1  # rad up a vertical slope, in proportion to the sine of the inclination on others
    lean_uncertain: float = 0.07  # rad up any slope of 30 deg and more, added where the surface is poorly known
    bank_share: float = 0.4  # share of the bank of a coordinated turn that is kept, of what exceeds `bank_from`
    bank_from: float = 0.18  # rad of bank of a coordinated turn up to which none is kept
    bank_most: float = 0.04  # rad of bank that is kept at most
    # Terminal attitude alignment.
    align_within: float = 0.12  # s to contact from which it acts
    align_shortest: float = 0.08  # s in which a misalignment is turned away at the fastest; less oscillates
    align_band: float = 0.08  # rad of predicted misalignment about each axis that are left alone
    align_sigmas: float = 3.0  # sigmas by which the surface is taken to be nearer than believed
    align_earliest: float = 0.04  # m by which the surface is taken to be nearer at most
    align_closing: float = 0.1  # m/s towards the board at least
    align_cosine: float = 0.5  # cosine between body z and the normal at least
    align_offset: float = 0.3  # m from the board's centre along its surface at most
    # Time-to-go flare.
    flare_within: float = 0.5  # s to contact from which it acts
    flare_shortest: float = 0.04  # s over which the mean rate is taken at least
    flare_closing: float = 0.5  # m/s towards the board at least
    flare_offset: float = 0.6  # m from the board's centre along its surface at most
    # Impact-speed limit.
    impact_speed: float = 0.5  # m/s into the board at contact that is braked to
    impact_within: float = 0.15  # s to contact from which it acts
    impact_tilt: float = 0.1  # rad between body z and the normal that are expected at contact
    impact_margin: float = 0.01  # m by which the surface is taken to be farther: braking too early ends in a hover
    impact_shortest: float = 0.01  # m of way over which the speed is braked at least
    impact_cosine: float = 0.8  # cosine between body z and the normal at least
    impact_offset: float = 0.3  # m from the board's centre along its surface at most
    sliding_low: float = 0.15  # m/s along the board at contact up to which it brakes fully
    sliding_high: float = 0.3  # m/s along the board at contact from which it does not brake

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0.0 <= value < math.inf:
                raise ValueError(
                    f"guidance parameter {item.name} is {value}; give a finite number that is not negative"
                )
        for low, high in (
            ("thrust_min", "thrust_max"), ("sigma_low", "sigma_high"), ("sliding_low", "sliding_high"),
        ):  # fmt: skip
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(f"guidance parameter {low} must be less than {high}")
        for name in ("rate_max", "align_shortest", "align_closing", "flare_shortest", "impact_shortest"):
            if getattr(self, name) <= 0.0:
                raise ValueError(f"guidance parameter {name} is {getattr(self, name)}; it must be positive")

    @classmethod
    def of(cls, airframe: Airframe, by_state: bool = False, **changes: float) -> GuidanceParams:
        """The parameters for `airframe`: its contact disc, limits and lags. `changes` override single fields.

        `by_state`: for flight by motion capture (BY_STATE)."""
        command, contact = airframe.command, airframe.contact
        own = {
            "below": contact.magnet_below,
            "radius": contact.footprint_radius,
            "thrust_min": command.thrust[0],
            "thrust_max": command.thrust[1],
            "rate_max": command.body_rate,
            "rate_lag": command.rate_lag,
            "thrust_lag": airframe.motors.lag,
            "flare_rate": command.body_rate * 34.0 / 35.0,
        }
        return cls(**{**own, **(BY_STATE if by_state else {}), **changes})

    def row(self) -> np.ndarray:
        """The (COUNT,) float64 row for kernels."""
        row = np.zeros(COUNT)
        for item in fields(self):
            row[globals()[item.name.upper()]] = getattr(self, item.name)
        return row
