"""An expert for training, on privileged information: the board's future, the motors' state and the true thrust gain.

The actions of an expert that is to be imitated must follow from what the student observes. So it does not choose among
ways to end a perch: thrust and shape of the last move are functions of the inclination alone. A plan has two parts: a
quintic to the state in which the last move begins, then the move, whose acceleration goes from zero to that of body z
on the board's normal. Near the board only the second part is planned.

A command changes the body rate only after the rate loop's lag. So plans begin with the vehicle as it will be then
(`lag.predict_vehicle`), and what is commanded now is what the plan demands then.
"""

from __future__ import annotations

from kernel.jit import njit
from kernel.rotations import body_z
from policies.environment import episode_row
from policies.environment.config import TICK
from policies.planner import polynomial as poly
from policies.planner.follow import face
from policies.planner.tracking import track_force
from policies.teachers import expert_row
from policies.teachers.expert_plan import make_plan
from policies.teachers.lag import predict_vehicle
from policies.teachers.params import AT
from vehicle.quadrotor import airframe_row
from vehicle.quadrotor.airframe import GRAVITY

_AXIS = expert_row.AXIS
_KP, _KV = 10.0, 6.0  # 1/s^2, 1/s: position and speed error to acceleration


@njit
def _follow(row, t, board, gain, drag, e, planner, out):
    """CTBR that follows the plan at time `t`, for which the vehicle is predicted."""
    middle, contact = row[expert_row.MIDDLE], row[expert_row.CONTACT]
    second = t >= middle
    at = expert_row.SECOND if second else expert_row.FIRST
    motion = row[at : at + expert_row.MOTION]
    end = contact if second else middle
    begun = row[expert_row.BEGUN] if not second or middle <= row[expert_row.BEGUN] else middle
    duration = end - begun
    now, left = min(duration, t - begun), contact - t
    ahead = min(duration, now + e[AT.ahead])
    soon = min(duration, max(0.0, now + e[AT.thrust_lag] - e[AT.predicted]))
    fade = min(1.0, max(0.0, left / e[AT.fade]))
    start = row[expert_row.START : expert_row.START + 9]
    p, v, q = start[:3], start[3:6], row[expert_row.ATTITUDE : expert_row.ATTITUDE + 4]
    x = row[expert_row.TARGET : expert_row.TARGET + 3]
    for k in range(3):
        gap = _KP * (poly.position(motion, k * _AXIS, now) - p[k]) + _KV * (
            poly.velocity(motion, k * _AXIS, now) - v[k]
        )
        x[k] = fade * gap + drag * v[k] + (GRAVITY if k == 2 else 0.0)
    fx, fy = x[0] + poly.acceleration(motion, 0, now), x[1] + poly.acceleration(motion, _AXIS, now)
    fz = x[2] + poly.acceleration(motion, 2 * _AXIS, now)
    gx, gy = x[0] + poly.acceleration(motion, 0, ahead), x[1] + poly.acceleration(motion, _AXIS, ahead)
    gz = x[2] + poly.acceleration(motion, 2 * _AXIS, ahead)
    jx, jy = poly.jerk(motion, 0, ahead), poly.jerk(motion, _AXIS, ahead)
    jz = poly.jerk(motion, 2 * _AXIS, ahead)
    zx, zy, zz = body_z(q)
    thrust = (
        (x[0] + poly.acceleration(motion, 0, soon)) * zx
        + (x[1] + poly.acceleration(motion, _AXIS, soon)) * zy
        + (x[2] + poly.acceleration(motion, 2 * _AXIS, soon)) * zz
    )
    yaw_rate = face(q, p, board, planner) if left > 0.4 else 0.0
    track_force(q, fx, fy, fz, gx, gy, gz, jx, jy, jz, yaw_rate, thrust, gain, planner, out)


@njit
def expert_step(rows, i, row, board, future, step, gain, e, planner, out):
    """The expert's CTBR for episode i into `out` (4,): body rate rad/s, thrust m/s^2.

    `row` expert row; `board` (8,) the true board now, `future` (K, 8) the same `step` s apart, from `predicted` s on,
    read when `expert_due`; `gain` achieved over commanded thrust; `e` row of ExpertParams; `planner` row of
    PlannerParams for the vehicle and the gains of the attitude loop.
    """
    params, now = rows.params[i], rows.state[i, episode_row.STEP] * TICK
    t = now + e[AT.predicted]
    drag = params[airframe_row.DRAG] / params[airframe_row.MASS]
    predict_vehicle(rows, i, row, e[AT.predicted], gain, drag, e)
    left = row[expert_row.CONTACT] - t
    frozen = row[expert_row.READY] > 0.0 and -e[AT.overdue] < left < e[AT.freeze]
    if expert_due(row, now) and not frozen:
        row[expert_row.NEXT] = now + e[AT.replan]
        make_plan(row, t, future, step, gain, drag, e, planner)
    _follow(row, t, board, gain, drag, e, planner, out)


@njit
def expert_due(row, t):
    """True if this step reads the whole future. `row` expert row; `t` s."""
    return t >= row[expert_row.NEXT] - 1e-6
