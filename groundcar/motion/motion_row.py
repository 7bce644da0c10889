"""Indices of a motion row, (DIM,) float64: path, speed law and state of the motion of one board.

The first entries, up to CHANGE_TIME, are the state of the motion; the rest is constant.
"""

from groundcar.motion import path_row, speed_row

TIME = 0  # s since the start
ETA = 1  # state of the speed law (groundcar.motion.speed_laws)
ACCEL = 2  # m/s^2, acceleration of LAW_SPEED
LAW_SPEED = 3  # m/s, speed with which the board answers the law; on a line the peak speed, else that of the board row
TRAVELLED = 4  # m
CHANGED = 5  # 1 once the path has become an arc
ARC_X, ARC_Y, ARC_ANGLE = 6, 7, 8  # m, m, rad: centre of the arc, angle at which it began
SLOPE = 9  # m per unit of u at the present u
CHANGE_TIME = 10  # s, when the path becomes an arc; inf: never
CHANGE_LENGTH = 11  # m travelled, the same
ARC_RADIUS = 12  # m, positive to the left
RESPONSE, DAMPING = 13, 14  # rad/s, 1
ACCEL_LIMIT = 15  # m/s^2
PATH_KIND, SPEED_KIND = 16, 17
SPEED = 18  # the speed row
PATH = SPEED + speed_row.DIM  # the path row
DIM = PATH + path_row.DIM
