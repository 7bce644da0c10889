"""Indices of the expert's row, (DIM,), one for each episode: plan and workspace. Times in s since the reset."""

from __future__ import annotations

from policies.planner.polynomial import COEFFICIENTS

AXIS = COEFFICIENTS  # numbers of a motion along one axis
MOTION = 3 * AXIS  # numbers of a motion

READY = 0  # 1: there is a plan
BEGUN, MIDDLE, CONTACT = 1, 2, 3  # when the plan's first part begins, when its second, when it makes contact
NEXT = 4  # when it plans next
COST = 5  # of the plan
FIRST, SECOND = 6, 6 + MOTION  # the plan's two motions
TRY1, TRY2 = 6 + 2 * MOTION, 6 + 3 * MOTION  # two motions that are tried
START = 6 + 4 * MOTION  # 9, position, velocity, acceleration of the vehicle as predicted: plans start from it
TARGET = START + 9  # 9, scratch: where the last move begins
BOARD = TARGET + 9  # 8, scratch
ATTITUDE = BOARD + 8  # 4, world from body, as predicted
DIM = ATTITUDE + 4
