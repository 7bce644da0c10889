"""The vehicle a moment ahead: a command given now turns it only then."""

from __future__ import annotations

import math

from kernel.jit import njit
from kernel.rotations import body_z, from_rotation_vector, multiply
from policies.environment import episode_row
from policies.teachers import expert_row
from policies.teachers.params import AT
from vehicle.quadrotor import airframe_row, command_row, state_row
from vehicle.quadrotor.airframe import GRAVITY

_MEAN = 0.4  # assumed: the share of the turn at which the thrust has its mean direction


@njit
def predict_vehicle(rows, i, row, time, gain, drag, e):
    """The vehicle of episode i in `time` s if the command flown last is kept, into START and ATTITUDE of `row`.

    Body rate and thrust approach the command as first-order lags: w(t) = w_c + (w - w_c) exp(-t / tau).
    `row` expert row; `gain` achieved over commanded thrust; `drag` 1/s; `e` row of ExpertParams.
    """
    vehicle, params, flown = rows.vehicle[i], rows.params[i], episode_row.COMMAND
    command = rows.state[i, flown : flown + command_row.DIM]
    wanted = command[command_row.THRUST] * gain
    lift = params[airframe_row.MOTOR_THRUST] / params[airframe_row.MASS]
    lift *= (
        vehicle[state_row.MOTOR]
        + vehicle[state_row.MOTOR + 1]
        + vehicle[state_row.MOTOR + 2]
        + vehicle[state_row.MOTOR + 3]
    )
    turning = e[AT.rate_lag] * (1.0 - math.exp(-time / e[AT.rate_lag]))
    kept = math.exp(-time / e[AT.thrust_lag])
    mean = wanted + (lift - wanted) * (1.0 - kept) * e[AT.thrust_lag] / time
    x = command[command_row.RATE] * (time - turning) + vehicle[state_row.W] * turning
    y = command[command_row.RATE + 1] * (time - turning) + vehicle[state_row.W + 1] * turning
    z = command[command_row.RATE + 2] * (time - turning) + vehicle[state_row.W + 2] * turning
    q, start = vehicle[state_row.Q : state_row.Q + 4], row[expert_row.START : expert_row.START + 9]
    later = multiply(q, from_rotation_vector(x, y, z))
    row[expert_row.ATTITUDE], row[expert_row.ATTITUDE + 1] = later[0], later[1]
    row[expert_row.ATTITUDE + 2], row[expert_row.ATTITUDE + 3] = later[2], later[3]
    along = body_z(multiply(q, from_rotation_vector(_MEAN * x, _MEAN * y, _MEAN * z)))
    end = body_z(later)
    for k in range(3):
        p, v, weight = vehicle[state_row.P + k], vehicle[state_row.V + k], GRAVITY if k == 2 else 0.0
        a = mean * along[k] - drag * v - weight
        start[k], start[3 + k] = p + time * (v + 0.5 * time * a), v + time * a
        start[6 + k] = (wanted + (lift - wanted) * kept) * end[k] - drag * start[3 + k] - weight
