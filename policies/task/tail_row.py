"""Indices of the observation's last (DIM,) numbers, after the history (policies.task.observation)."""

V = 0  # 3, m/s, yaw frame
R = 3  # 9, row-major, yaw frame from body
RHO = 12
ACTION = 13  # 4, previous action, in [-1, 1]
GAIN = 17  # estimated thrust gain: achieved over asked
DRAG = 18  # 1/s, estimated
SIGMA = 19  # m, of the board's surface
DIM = 20
