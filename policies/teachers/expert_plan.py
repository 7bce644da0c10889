"""The expert's plan: an approach to the state in which the last move begins, then the last move to contact."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.jit import njit
from policies.planner import polynomial as poly
from policies.prediction.future import board_at
from policies.teachers import expert_row
from policies.teachers.cost import motion_cost
from policies.teachers.params import AT
from vehicle.quadrotor.airframe import GRAVITY

_LONG, _SHORT = 18, 6  # durations tried
_NEAR = (-0.05, -0.025, 0.0, 0.025, 0.05, 0.1)  # s, changes of the contact's time tried for a plan near contact
_LONGEST = 8.4  # the longest duration over the shortest, 0.5 s
_REFINE = 3  # halvings of the step around the best duration


@njit
def _fit_move(row, future, step, contact, drag, e):
    """The last move, ending `contact` s from now: its motion into TRY2, the state it begins with into TARGET.

    Returns its length.
    """
    board, begin = (
        row[expert_row.BOARD : expert_row.BOARD + board_row.DIM],
        row[expert_row.TARGET : expert_row.TARGET + 8],
    )
    board_at(future, step, contact, board)
    si, ci = math.sin(board[board_row.INCLINATION]), math.cos(board[board_row.INCLINATION])
    length = e[AT.move]
    thrust = max(e[AT.thrust_flat] * GRAVITY * ci, e[AT.thrust_steep])
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    nx, ny, nz = -si * ch, -si * sh, ci
    first, second, glide = 0.5 + e[AT.ease] / 6.0, 1.0 / 6.0 + e[AT.ease] / 12.0, e[AT.glide] * ci * ci
    for k in range(3):
        n = nx if k == 0 else (ny if k == 1 else nz)
        v = -e[AT.impact] * n + (
            board[board_row.SPEED] * ch if k == 0 else (board[board_row.SPEED] * sh if k == 1 else 0.0)
        )
        a = thrust * n - drag * v - (GRAVITY if k == 2 else 0.0)
        p = board[k] + e[AT.over] * n
        begin[3 + k] = v - a * length * first
        begin[k] = p - begin[3 + k] * length - a * length * length * second
        ahead = ch if k == 0 else (sh if k == 1 else 0.0)
        begin[3 + k] += glide * ahead
        begin[k] -= 0.5 * glide * length * ahead
        poly.fit_axis(begin[k], begin[3 + k], 0.0, p, v, a, length, 0.0, row, expert_row.TRY2 + k * expert_row.AXIS)
    return length


@njit
def _fit_end(row, future, step, contact, drag, e):
    """From the present state straight to the board in `contact` s: into TRY1.

    Late corrections across the normal would tilt the vehicle, and the board is large: the nearer contact is, the more
    the plan ends where the vehicle drifts anyway (free end position), up to `miss`.
    """
    target, start = (
        row[expert_row.BOARD : expert_row.BOARD + board_row.DIM],
        row[expert_row.START : expert_row.START + 9],
    )
    board_at(future, step, contact, target)
    si, ci = math.sin(target[board_row.INCLINATION]), math.cos(target[board_row.INCLINATION])
    thrust = max(e[AT.thrust_flat] * GRAVITY * ci, e[AT.thrust_steep])
    ch, sh = math.cos(target[board_row.HEADING]), math.sin(target[board_row.HEADING])
    natural, end = row[expert_row.TARGET : expert_row.TARGET + 3], row[expert_row.TARGET + 3 : expert_row.TARGET + 9]
    n = (-si * ch, -si * sh, ci)
    along = 0.0
    for k in range(3):
        board = target[board_row.SPEED] * ch if k == 0 else (target[board_row.SPEED] * sh if k == 1 else 0.0)
        end[k] = board - e[AT.impact] * n[k]
        end[3 + k] = thrust * n[k] - drag * end[k] - (GRAVITY if k == 2 else 0.0)
        mean, bend = 0.5 * (start[3 + k] + end[k]), (start[6 + k] - end[3 + k]) / 12.0
        natural[k] = start[k] + contact * mean + contact * contact * bend - target[k]
        along += natural[k] * n[k]
    miss = 0.0
    for k in range(3):
        natural[k] -= along * n[k]
        miss += natural[k] * natural[k]
    free = min(1.0, max(0.0, (e[AT.aim] - contact) / (0.5 * e[AT.aim])))
    free *= min(1.0, e[AT.miss] / max(math.sqrt(miss), 1e-6))
    for k in range(3):
        p = target[k] + e[AT.over] * n[k] + free * natural[k]
        at = expert_row.TRY1 + k * expert_row.AXIS
        poly.fit_axis(start[k], start[3 + k], start[6 + k], p, end[k], end[3 + k], contact, e[AT.flatten], row, at)


@njit
def _try_pair(row, t, contact, late, future, step, gain, drag, e, planner):
    """Try a plan of two parts with contact in `contact` s; keep it if it is the cheapest so far."""
    start, begin = row[expert_row.START : expert_row.START + 9], row[expert_row.TARGET : expert_row.TARGET + 8]
    length = _fit_move(row, future, step, contact, drag, e)
    duration = contact - length
    if duration < 0.1:
        return
    for k in range(3):
        at = expert_row.TRY1 + k * expert_row.AXIS
        poly.fit_axis(start[k], start[3 + k], start[6 + k], begin[k], begin[3 + k], 0.0, duration, 0.0, row, at)
    cost = e[AT.w_time] * contact + e[AT.w_postpone] * max(0.0, late)
    if cost < row[expert_row.COST]:
        limit = row[expert_row.COST] - cost
        cost += motion_cost(row, expert_row.TRY1, duration, 0.0, length, future, step, gain, drag, e, planner, limit)
    if cost < row[expert_row.COST]:
        limit = row[expert_row.COST] - cost
        cost += motion_cost(row, expert_row.TRY2, length, duration, 0.0, future, step, gain, drag, e, planner, limit)
    if cost < row[expert_row.COST]:
        row[expert_row.COST] = cost
        tried = row[expert_row.TRY1 : expert_row.TRY1 + 2 * expert_row.MOTION]
        row[expert_row.FIRST : expert_row.FIRST + 2 * expert_row.MOTION] = tried
        row[expert_row.BEGUN], row[expert_row.MIDDLE], row[expert_row.CONTACT] = t, t + duration, t + contact


@njit
def _try_end(row, t, contact, late, future, step, gain, drag, e, planner):
    """Try to go straight to the board in `contact` s; keep it if it is the cheapest so far."""
    _fit_end(row, future, step, contact, drag, e)
    cost = e[AT.w_time] * contact + e[AT.w_postpone] * max(0.0, late)
    if cost < row[expert_row.COST]:
        limit = row[expert_row.COST] - cost
        cost += motion_cost(row, expert_row.TRY1, contact, 0.0, 0.0, future, step, gain, drag, e, planner, limit)
    if cost < row[expert_row.COST]:
        row[expert_row.COST] = cost
        tried = row[expert_row.TRY1 : expert_row.TRY1 + expert_row.MOTION]
        row[expert_row.SECOND : expert_row.SECOND + expert_row.MOTION] = tried
        row[expert_row.BEGUN], row[expert_row.MIDDLE], row[expert_row.CONTACT] = t, t, t + contact


@njit
def make_plan(row, t, future, step, gain, drag, e, planner):
    """Make a new plan: near contact by varying the plan under way, before that independently of it.

    A plan that depended on earlier choices would depend on a state that the student does not observe.
    """
    left = row[expert_row.CONTACT] - t
    row[expert_row.COST] = math.inf
    if row[expert_row.READY] > 0.0 and -e[AT.overdue] < left < e[AT.local]:
        for change in _NEAR:
            _try_end(row, t, max(0.1, left + change), change, future, step, gain, drag, e, planner)
    if row[expert_row.COST] > e[AT.give_up]:
        for k in range(_LONG):
            _try_pair(row, t, 0.5 * _LONGEST ** (k / (_LONG - 1)), 0.0, future, step, gain, drag, e, planner)
        for k in range(_SHORT):
            _try_end(row, t, 0.15 * 4.0 ** (k / (_SHORT - 1)), 0.0, future, step, gain, drag, e, planner)
        span = 0.05 * (row[expert_row.CONTACT] - t)
        for _ in range(_REFINE):
            best, pair = row[expert_row.CONTACT] - t, row[expert_row.MIDDLE] > row[expert_row.BEGUN]
            for side in (-span, span):
                if pair:
                    _try_pair(row, t, best + side, 0.0, future, step, gain, drag, e, planner)
                else:
                    _try_end(row, t, max(0.1, best + side), 0.0, future, step, gain, drag, e, planner)
            span *= 0.5
    row[expert_row.READY] = 1.0 if row[expert_row.COST] < math.inf else 0.0
