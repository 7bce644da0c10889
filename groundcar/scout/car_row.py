"""Indices of the simulated car's state row, (DIM,) float64 (groundcar.scout.physics)."""

X, Y, HEADING = 0, 1, 2  # m, m, rad (not wrapped); truth
SPEED, TURN_RATE = 3, 4  # m/s, rad/s; truth
WHEEL_SPEED, WHEEL_ACCEL, WHEEL_TURN = 5, 6, 7  # m/s, m/s^2, rad/s; what the wheels report
SPEED_NOISE, TURN_NOISE = 8, 9  # m/s, rad/s
LEFT, RIGHT = 10, 11  # m rolled by the wheels of each side
DIM = 12
