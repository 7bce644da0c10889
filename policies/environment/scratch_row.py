"""Indices of a scratch row, (DIM,). Odometry is kept from one observation to the next, the rest within a step only."""

OBSERVED = 0  # 10, observed board with its sigmas (vehicle.camera.detection_row)
Z, R = 10, 15  # 5 each, measurement for the filter and its variances
COMMAND = 20  # 4, command of this step, rad/s FLU and m/s^2
BOARD = 24  # 8, true board now
Q, P, V = 32, 36, 39  # odometry: orientation (4), position (3), velocity (3)
SIGMA = 42  # 3, m, of the observed position
FLOWN = 45  # 4, action of this step in [-1, 1] as it is flown
DIM = 49
