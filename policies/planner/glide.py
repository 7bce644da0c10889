"""The glide: a shallow approach to a flat board from behind, during which the camera keeps the board in view.

The camera looks forward. A vehicle that descends from above loses a flat board 0.5 s and more before contact, and the
belief of a board at 3 m/s is then wrong by as much as the tolerance. So this approach is shallow. Backward in time from
contact it has a constant sink rate, and a speed along the board that grows as slowly as a nearly level vehicle can
brake. It ends short of the board's centre; the small tags at the board's upper edge are in view until then.

The law depends on the present belief alone: no plan can become outdated, and a network can learn it.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.clip import clip
from kernel.jit import njit
from policies.planner import params_row as pp
from policies.planner.follow import command_acceleration, keep_in_view
from policies.planner.tracking import yaw_error
from policies.task.observation import USUAL_DRAG

_SHORT, _ALONG = 0.07, 0.2  # m behind the board's centre and m/s along it at contact
_BRAKE, _SINK = 0.87, 0.42  # m/s^2 along the board, m/s down (see `glide_sink`)
_FASTEST, _HIGHEST = 2.6, 1.25  # m/s of closing along the board and m over it at most
_BY_DRAG, _MOST_DRAG = 0.2, 0.3  # m/s of sink by 1/s of drag above the usual; 1/s of such drag that count at most
_BY_TURN, _USUAL_TURN, _HARD = 0.07, 0.35, 1.05  # m/s less by rad/s of the board's turn above the usual, at most
_BY_AGE, _YOUNG, _OLD = 0.27, 0.045, 0.15  # m/s more by s without a detection above the usual, at most
_KV, _KV_UP, _KP_SIDE, _KP_UP = 4.15, 6.4, 2.3, 2.9  # 1/s
_LAST, _MORE = 0.4, 0.8  # m over the board below which _KP_SIDE grows; share by which it is larger at contact
_AHEAD = 0.12  # s from commanding an acceleration to reaching it
_SIDEWAYS, _UPWARD = 2.7, 1.6  # 1/s: sideways speed by (distance + _MARGIN) at most; m/s: correction of height at most
_LOW, _FALL = 0.36, 1.1  # m over the board below which the sink rate is limited; times the reference's
_MARGIN, _ROOM, _NEAR = (
    0.3,
    0.5,
    0.25,
)  # m; error by (distance + _MARGIN) above which closing stops; m, nearer it goes on
_PRESS_AWAY, _PRESS_SIDE, _PRESS = 0.2, 0.15, 0.3  # m, m, m/s: nearer than that it sinks at least so fast
_BEHIND, _BEARING = 0.75, 3.6  # m: nearer it closes along the board's heading, farther along the line of sight
_UNSEEN, _STOP = 1.0, 0.35  # s without a detection after which closing stops; m, nearer it goes on
_VIEW, _TURN = 0.4, 0.2  # m of horizontal distance below which the view no longer limits pitch, and yaw is left alone
_TILT = 0.7  # rad
_YAW_K, _YAW_MOST = 1.9, 2.0  # 1/s, rad/s
_PASSED, _UNDER = -0.3, -0.06  # m: beyond the centre, or below the surface, the board counts as missed


@njit
def glide_sink(drag, turn, age):
    """Sink rate (m/s) for `drag` 1/s of the vehicle, `turn` rad/s of the board, `age` s since the last detection.

    With less drag the vehicle has to lean back to brake, and its camera loses the board sooner; a lower sink rate makes
    the approach lower. The coefficients are tuned in simulated flights.
    """
    dragged, turning = min(_MOST_DRAG, drag - USUAL_DRAG), min(_HARD, abs(turn)) - _USUAL_TURN
    return _SINK + _BY_DRAG * dragged - _BY_TURN * turning + _BY_AGE * (min(_OLD, age) - _YOUNG)


@njit
def glide_reference(away, sink):
    """(closing m/s, sink m/s by m/s of closing, height m, s to contact) where the board's centre is `away` m ahead.

    `sink` m/s, constant until contact.
    """
    if away <= _SHORT:
        left = (away - _SHORT) / _ALONG
        return _ALONG, sink / _ALONG, sink * left, left
    closing = math.sqrt(_ALONG * _ALONG + 2.0 * _BRAKE * (away - _SHORT))
    left = (closing - _ALONG) / _BRAKE
    height = sink * left
    return min(_FASTEST, closing), (sink / closing if height < _HIGHEST else 0.0), min(_HIGHEST, height), left


@njit
def glide(p, v, q, board, acceleration, age, gain, params, out):
    """Fly the glide; fills `out` (4,). Returns True if the board was missed: it is behind the vehicle, or above it.

    `p`, `v` (3,) world, `q` (4,) world from body; `board` (8,) the board now, `acceleration` m/s^2 its own along its
    heading, `age` s since the last detection.
    """
    c, s = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    speed, turn = board[board_row.SPEED], board[board_row.TURN_RATE]
    # The board's acceleration is taken along its heading at the time at which the vehicle will have reached it.
    then = board[board_row.HEADING] + _AHEAD * turn
    bx = acceleration * math.cos(then) - turn * speed * math.sin(then)
    by = acceleration * math.sin(then) + turn * speed * math.cos(then)
    dx, dy = board[board_row.X] - p[0], board[board_row.Y] - p[1]
    distance = math.sqrt(dx * dx + dy * dy)
    behind = clip((_BEARING - distance) / (_BEARING - _BEHIND), 0.0, 1.0)
    sight = (1.0 - behind) / max(distance, 1e-6)
    ux, uy = behind * c + sight * dx, behind * s + sight * dy
    norm = math.sqrt(ux * ux + uy * uy)
    if norm < 0.1:  # heading and line of sight cancel: the board comes towards the vehicle
        ux, uy, norm = c, s, 1.0
    ux, uy = ux / norm, uy / norm
    away, side = dx * ux + dy * uy, dy * ux - dx * uy
    height = p[2] - board[board_row.Z] - params[pp.vehicle.contact_below]
    falling = glide_sink(params[pp.vehicle.drag], turn, age)
    closing, sink, wanted, left = glide_reference(away, falling)
    brake = _BRAKE if left > 0.0 and closing < _FASTEST else 0.0
    if away > _NEAR:
        error = math.sqrt(0.5 * side * side + 0.6 * (height - wanted) * (height - wanted))
        share = clip(2.0 - error / (_ROOM * (_MARGIN + away)), 0.0, 1.0)
        if age > _UNSEEN and away > _STOP:
            share = 0.0
        closing, brake = closing * share, brake * share * share
    rx, ry = v[0] - speed * c, v[1] - speed * s
    nearing, drift = rx * ux + ry * uy, ry * ux - rx * uy
    # The reference is fixed to the board, so it moves sideways when the board turns.
    carried = behind * turn
    most = _SIDEWAYS * (_MARGIN + abs(away))
    stiff = _KP_SIDE * (1.0 + _MORE * clip(1.0 - height / _LAST, 0.0, 1.0))
    forward = _KV * (closing - nearing) - brake + carried * turn * away
    sideways = _KV * (clip(stiff * side, -most, most) - carried * away - drift) + 2.0 * carried * nearing
    ax, ay = forward * ux - sideways * uy + bx, forward * uy + sideways * ux + by
    fall = clip(_KP_UP * (wanted - height), -_UPWARD, _UPWARD) - sink * max(0.0, nearing)
    if height < _LOW:
        fall = max(fall, -_FALL * falling)
    # Alignment levels the vehicle, which leaves drag uncompensated: without this it would fall back and hover.
    if away < _PRESS_AWAY and abs(side) < _PRESS_SIDE:
        fall = min(fall, -_PRESS)
    if distance > _VIEW:
        ax, ay = keep_in_view(ax, ay, p, board, params)
    yaw_rate = 0.0
    if distance > _TURN:
        yaw_rate = _YAW_K * yaw_error(q, dx, dy) * min(1.0, distance / _VIEW)
        yaw_rate = clip(yaw_rate, -_YAW_MOST, _YAW_MOST)
    if distance > _VIEW:
        yaw_rate -= drift / distance
    command_acceleration(q, v[0], v[1], v[2], ax, ay, _KV_UP * (fall - v[2]), yaw_rate, _TILT, gain, params, out)
    return away < _PASSED or (height < _UNDER and away < _NEAR)
