"""Indices of the noise row (LENGTH,): one sigma and time constant (s) of the estimate's errors; white sensor noise."""

POSITION_SIGMA, POSITION_TAU = 0, 1  # m, s
VELOCITY_SIGMA, VELOCITY_TAU = 2, 3  # m/s, s
ATTITUDE_SIGMA, ATTITUDE_TAU = 4, 5  # rad, s
GYRO_SIGMA = 6  # 3, rad/s, per sample: roll, pitch, yaw
ACCEL_SIGMA = 9  # m/s^2, per sample
LENGTH = 10
