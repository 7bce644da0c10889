"""The belief's motion model, CTRV with a decaying forward acceleration, and the filter's parameters."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np

from kernel.jit import njit
from policies.estimation import belief_state, filter_row

CALM, LIVELY = 0, 1  # models of a small and of a large acceleration (policies.estimation.imm)
STEP = 0.05  # s, longest step of the prediction
LONGEST = 30.0  # s, longest prediction: a board not seen for so long is unknown, and a broken stamp costs no time


@dataclass(frozen=True)
class BeliefParams:
    """Noise and rules of the filter. `q_*` are random walks: one-sigma growth in one second.

    `gate`: limit of the innovation test, chi-square at 5 degrees of freedom (0.1 % of good measurements are refused).
    `reaccept`: agreeing refusals that restart the filter; 2 suffice after `reaccept_loss` s without a measurement.
    Prior at a start: speed `speed0` +- `speed_sigma`, turn rate 0 +- `turn_sigma`. `accel_sigma`, `accel_tau`: Singer
    acceleration; the size is nearly that of the paper's Hard-I law (1.6 m/s^2 peak), but it decays fast, as under the
    paper's OU speeds. The turn rate wanders by `q_turn` and `q_bend` (rad/m) times the speed: curvature changes with
    the distance driven. Headings are measured with a bias of N(0, `bias_heading`) that is constant from a start on.
    `q_position` and `q_inclination` also cover errors of odometry and calibration that vary slowly during the approach.
    rho = exp(-lambda_rho T_loss); the loss begins `loss_after` s after the last exposure: a 20 Hz detector 60 ms late
    is 110 ms old without any loss, and lambda_rho 2 halves rho in 0.35 s. Valid: `valid_after` accepted, and younger
    than `max_age`. Two models (policies/estimation/imm.py): in the calm one the acceleration's size is `calm_accel`,
    which is enough for the paper's OU speeds. Where positions are measured better than `calm_noise` m the lively model
    is expected, from twice that on the calm one; the model probabilities forget in `settle` s. From `loss_after` s on
    after the last exposure the turn rate decays with `turn_tau`. With it hard turns (above 0.6 rad/s at 2 m/s) are
    predicted to 0.8 m and 24 deg over 2 s, without it to 1.1 m and 45 deg. A standing car tends to remain standing: the
    noise of speed and acceleration is scaled by `quiet` + (|speed| + 2 |acceleration|) / `busy_speed`, at most 1.
    `speed_sigma`, `turn_sigma`, `accel_*`, `q_speed`, `q_turn`, `q_bend`, `q_heading`, `quiet`, `busy_speed`, `calm_*`
    and `settle` are near the least errors of position, twist and position 0.4 s later, on the detections of flights at
    the paper's operating points with both noises (tuning seeds).
    """

    gate: float = 20.515
    reaccept: int = 3
    reaccept_loss: float = 1.0
    max_speed: float = 4.0
    max_turn: float = 2.0
    speed0: float = 0.5
    speed_sigma: float = 1.0
    turn_sigma: float = 0.4
    accel_sigma: float = 1.5
    accel_tau: float = 0.25
    q_speed: float = 0.11
    q_turn: float = 0.03
    q_heading: float = 0.02
    q_position: float = 0.03
    q_inclination: float = 0.02
    bias_heading: float = 0.02
    lambda_rho: float = 2.0
    loss_after: float = 0.11
    valid_after: int = 3
    max_age: float = 2.0
    quiet: float = 0.12
    busy_speed: float = 2.5
    calm_accel: float = 0.15
    calm_noise: float = 0.02
    settle: float = 1.0
    q_bend: float = 0.31
    turn_tau: float = 2.0

    def __post_init__(self) -> None:
        for name, value in zip(self.__dataclass_fields__, astuple(self), strict=True):
            if not math.isfinite(value) or (value < 0.0 and name != "speed0"):
                raise ValueError(f"belief parameter {name} is {value}; give a finite number that is not negative")
        if min(self.accel_tau, self.turn_tau, self.busy_speed, self.settle, self.gate) <= 0.0 or self.reaccept < 2:
            raise ValueError(
                "belief parameters accel_tau, turn_tau, busy_speed, settle and gate must be positive, "
                "reaccept at least 2"
            )

    def row(self) -> np.ndarray:
        """The row for kernels."""
        return np.array(astuple(self), dtype=np.float64)


@njit
def wrap(angle):
    """An angle in (-pi, pi]."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@njit
def advance_state(x, dt, tau):
    """One CTRV step with decaying acceleration on x[0:8], in place. Exact on an arc at constant speed."""
    decay = math.exp(-dt / tau)
    gained = x[belief_state.ACCELERATION] * tau * (1.0 - decay)
    mean = x[belief_state.SPEED] + x[belief_state.ACCELERATION] * tau - gained * tau / dt
    half = 0.5 * x[belief_state.TURN_RATE] * dt
    chord = mean * dt * (1.0 - half * half / 6.0)
    x[belief_state.X] += chord * math.cos(x[belief_state.HEADING] + half)
    x[belief_state.Y] += chord * math.sin(x[belief_state.HEADING] + half)
    x[belief_state.HEADING] += x[belief_state.TURN_RATE] * dt
    x[belief_state.SPEED] += gained
    x[belief_state.ACCELERATION] *= decay


@njit
def drive_sigma(params, lively):
    """Size of the acceleration (m/s^2) of a board for which the lively model has probability `lively`."""
    return math.sqrt((1.0 - lively) * params[filter_row.CALM_ACCEL] ** 2 + lively * params[filter_row.ACCEL_SIGMA] ** 2)


@njit
def advance_covariance(x, p, dt, params, lively):
    """P <- F P F' + Q for the step that starts at x; p is (81,), in place; `lively`: probability of that model.

    Rows X, Y, HEADING, SPEED and ACCELERATION of F differ from the identity.
    """
    tau = params[filter_row.ACCEL_TAU]
    decay = math.exp(-dt / tau)
    gain = tau * (1.0 - decay)
    mean_gain = tau * (1.0 - gain / dt)
    angle = x[belief_state.HEADING] + 0.5 * x[belief_state.TURN_RATE] * dt
    c, s = math.cos(angle), math.sin(angle)
    chord = (x[belief_state.SPEED] + x[belief_state.ACCELERATION] * mean_gain) * dt
    for side in range(2):  # rows, then columns
        a, b = (belief_state.DIM, 1) if side == 0 else (1, belief_state.DIM)
        for j in range(belief_state.DIM):
            k = j * b
            psi, v = p[belief_state.HEADING * a + k], p[belief_state.SPEED * a + k]
            w, acc = p[belief_state.TURN_RATE * a + k], p[belief_state.ACCELERATION * a + k]
            turned, moved = chord * (psi + 0.5 * dt * w), dt * (v + mean_gain * acc)
            p[belief_state.X * a + k] += c * moved - s * turned
            p[belief_state.Y * a + k] += s * moved + c * turned
            p[belief_state.HEADING * a + k] = psi + dt * w
            p[belief_state.SPEED * a + k] = v + gain * acc
            p[belief_state.ACCELERATION * a + k] = decay * acc
    d = belief_state.DIM + 1
    q_p = params[filter_row.Q_POSITION] ** 2 * dt
    p[belief_state.X * d] += q_p
    p[belief_state.Y * d] += q_p
    p[belief_state.Z * d] += 0.25 * q_p
    p[belief_state.HEADING * d] += params[filter_row.Q_HEADING] ** 2 * dt
    busy = (
        min(
            1.0,
            params[filter_row.QUIET]
            + (abs(x[belief_state.SPEED]) + 2.0 * abs(x[belief_state.ACCELERATION])) / params[filter_row.BUSY_SPEED],
        )
        ** 2
    )
    p[belief_state.SPEED * d] += busy * params[filter_row.Q_SPEED] ** 2 * dt
    p[belief_state.TURN_RATE * d] += (
        params[filter_row.Q_TURN] + params[filter_row.Q_BEND] * abs(x[belief_state.SPEED])
    ) ** 2 * dt
    p[belief_state.INCLINATION * d] += params[filter_row.Q_INCLINATION] ** 2 * dt
    p[belief_state.ACCELERATION * d] += busy * drive_sigma(params, lively) ** 2 * (1.0 - decay * decay)


@njit
def steps_in(span):
    """Equal steps, none longer than STEP, that `span` s, LONGEST at most, are cut into.

    Rounding does not decide at whole multiples of STEP.
    """
    return max(1, math.ceil(min(span, LONGEST) / STEP - 1e-6)) if span > 0.0 else 1


@njit
def advance(x, p, span, params, lively):
    """Predict state and covariance by `span` s, LONGEST at most; `lively`: probability of the lively model (0..1)."""
    span = min(span, LONGEST)
    if span > 0.0:
        steps = steps_in(span)
        for _ in range(steps):
            advance_covariance(x, p, span / steps, params, lively)
            advance_state(x, span / steps, params[filter_row.ACCEL_TAU])
