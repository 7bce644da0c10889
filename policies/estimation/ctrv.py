"""How the belief expects the board to move: CTRV with a decaying forward acceleration, and the filter's parameters."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np

from kernel.jit import njit

N = 9  # state: [x, y, z, heading, speed, turn_rate, inclination, acceleration, heading_bias]

(GATE, REACCEPT, REACCEPT_LOSS, MAX_SPEED, MAX_TURN, SPEED0, SPEED_SIGMA, TURN_SIGMA, ACCEL_SIGMA, ACCEL_TAU,
 Q_SPEED, Q_TURN, Q_HEADING, Q_POSITION, Q_INCLINATION, BIAS_HEADING, LAMBDA_RHO,
 LOSS_AFTER, VALID_AFTER, MAX_AGE, QUIET, BUSY_SPEED, CALM_ACCEL, CALM_NOISE, SETTLE, Q_BEND,
 TURN_TAU) = range(27)  # fmt: skip
CALM, LIVELY = 0, 1  # how the board may be driven
STEP = 0.05  # s, longest step of the prediction


@dataclass(frozen=True)
class BeliefParams:
    """Noise and rules of the filter. `q_*` are random walks: one-sigma growth in one second.

    `gate`: chi-square limit at 5 degrees of freedom (0.1 % of good measurements are refused). `reaccept`: agreeing
    refusals that restart the filter; 2 suffice after `reaccept_loss` s without a measurement. Prior at a start: speed
    `speed0` +- `speed_sigma`, turn rate 0 +- `turn_sigma`. `accel_sigma`, `accel_tau`: Singer acceleration; the size is
    nearly that of the paper's Hard-I law (1.6 m/s^2 peak), but it is soon over: its OU speeds do not keep gaining.
    The turn rate wanders by `q_turn` and `q_bend` (rad/m) times the speed: a path has bends, and a slow car comes
    slowly into the next. Headings are measured with a bias of N(0, `bias_heading`), constant from a start on: where the
    board goes tells it from its heading.
    `q_position` and `q_inclination` also take up that errors of odometry and calibration wander while the drone
    approaches.
    rho = exp(-lambda_rho T_loss); the loss begins `loss_after` s after the last exposure: a 20 Hz detector 60 ms late
    is 110 ms old without any loss, and lambda_rho 2 halves rho in 0.35 s. Valid: `valid_after` accepted, and younger
    than `max_age`.
    A board is driven calmly or lively (see `belief_models`): calmly, the acceleration's size is `calm_accel`, which is
    enough for the paper's OU speeds. Where positions are measured better than `calm_noise` m it is taken to be lively,
    from twice that on it is expected to be calm; evidence counts for `settle` s.
    A bend that is no longer seen ends: from `loss_after` s on after the last exposure the turn rate decays by
    `turn_tau`. With it hard turns (above 0.6 rad/s at 2 m/s) are foretold to 0.8 m and 24 deg over 2 s, without it to
    1.1 m and 45 deg.
    A car that stands goes on standing: the noise of speed and acceleration is scaled by `quiet` +
    (|speed| + 2 |acceleration|) / `busy_speed`, at most 1.
    `speed_sigma`, `turn_sigma`, `accel_*`, `q_speed`, `q_turn`, `q_bend`, `q_heading`, `quiet`, `busy_speed`,
    `calm_*` and `settle` are near the least errors of where the board is, how it moves and where it is 0.4 s later, on
    what the detector saw in flights at the tables' points with both noises (tuning seeds).
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
    gained = x[7] * tau * (1.0 - decay)
    mean = x[4] + x[7] * tau - gained * tau / dt
    half = 0.5 * x[5] * dt
    chord = mean * dt * (1.0 - half * half / 6.0)
    x[0] += chord * math.cos(x[3] + half)
    x[1] += chord * math.sin(x[3] + half)
    x[3] += x[5] * dt
    x[4] += gained
    x[7] *= decay


@njit
def drive_sigma(params, lively):
    """Size of the acceleration (m/s^2) of a board that is driven lively by this share."""
    return math.sqrt((1.0 - lively) * params[CALM_ACCEL] ** 2 + lively * params[ACCEL_SIGMA] ** 2)


@njit
def advance_covariance(x, p, dt, params, lively):
    """P <- F P F' + Q for the step that starts at x; p is (64,), in place. Rows 0, 1, 3, 4, 7 of F are not trivial."""
    tau = params[ACCEL_TAU]
    decay = math.exp(-dt / tau)
    gain = tau * (1.0 - decay)
    mean_gain = tau * (1.0 - gain / dt)
    angle = x[3] + 0.5 * x[5] * dt
    c, s = math.cos(angle), math.sin(angle)
    chord = (x[4] + x[7] * mean_gain) * dt
    for side in range(2):  # rows, then columns
        a, b = (N, 1) if side == 0 else (1, N)
        for j in range(N):
            k = j * b
            psi, v, w, acc = p[3 * a + k], p[4 * a + k], p[5 * a + k], p[7 * a + k]
            turned, moved = chord * (psi + 0.5 * dt * w), dt * (v + mean_gain * acc)
            p[k] += c * moved - s * turned
            p[a + k] += s * moved + c * turned
            p[3 * a + k] = psi + dt * w
            p[4 * a + k] = v + gain * acc
            p[7 * a + k] = decay * acc
    d = N + 1
    q_p = params[Q_POSITION] ** 2 * dt
    p[0] += q_p
    p[d] += q_p
    p[2 * d] += 0.25 * q_p
    p[3 * d] += params[Q_HEADING] ** 2 * dt
    busy = min(1.0, params[QUIET] + (abs(x[4]) + 2.0 * abs(x[7])) / params[BUSY_SPEED]) ** 2
    p[4 * d] += busy * params[Q_SPEED] ** 2 * dt
    p[5 * d] += (params[Q_TURN] + params[Q_BEND] * abs(x[4])) ** 2 * dt
    p[6 * d] += params[Q_INCLINATION] ** 2 * dt
    p[7 * d] += busy * drive_sigma(params, lively) ** 2 * (1.0 - decay * decay)


@njit
def steps_in(span):
    """Equal steps, none longer than STEP, that `span` s are cut into; rounding does not decide at whole multiples."""
    return max(1, math.ceil(span / STEP - 1e-6))


@njit
def advance(x, p, span, params, lively):
    """Carry state and covariance on by `span` s, with the noise of a board driven lively by this share (0..1)."""
    steps = steps_in(span)
    if span > 0.0:
        for _ in range(steps):
            advance_covariance(x, p, span / steps, params, lively)
            advance_state(x, span / steps, params[ACCEL_TAU])
