"""Indices of a planner's state row, (DIM,) float64: all that it keeps between ticks. Times in s, world ENU."""

from __future__ import annotations

from policies.estimation import thrust_row
from policies.planner.params_row import COUNT
from policies.planner.search import MOTION_DIM
from policies.prediction import oscillation_row
from policies.prediction.speed_history import HISTORY_DIM

PHASE = 0  # one of `phases.PHASES`, by its index
BEGUN, CONTACT = 1, 2  # when the motion under way began, and when it makes contact
NEXT = 3  # when it plans next
ENGAGED = 4  # when the board was first seen; -1: not yet
THRUST, COST = 5, 6  # m/s^2 at contact of the plan taken over last; cost of the plan found last
LAST = 7  # the tick before
UNTIL = 8  # when climbing away may end
PLANS, MISSES = 9, 10  # counts
FLARE = 11  # when a run-up ends and the flare begins
AWAY = 12  # m, distance from the start of the run-up, with 0.3 s times the difference in velocity
ACCELERATION = 13  # m/s^2, of the board along its heading
ASKED = 14  # 4, commanded last: body rate FLU, rad/s, and thrust, m/s^2
GAIN = ASKED + 4  # the thrust-gain row, see `thrust_drag`
MOTION = GAIN + thrust_row.DIM  # the motion under way
BEST, TRY = MOTION + MOTION_DIM, MOTION + 2 * MOTION_DIM  # scratch of the search
START = MOTION + 3 * MOTION_DIM  # 9, position, velocity, acceleration at the start of a plan
BOARD = START + 9  # 8, scratch
HISTORY = BOARD + 8  # the board's speeds, see `speed_history`
FIT = HISTORY + HISTORY_DIM  # their fit
TARGET = FIT + oscillation_row.DIM  # 8, scratch
OWN = TARGET + 8  # the parameters, with the drag that was found and the contact speed for this belief
DIM = OWN + COUNT
