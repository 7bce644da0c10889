"""Indices of the snapshot row (LENGTH,): what the streams report, NED and FRD, relative to PX4's local origin."""

POSITION, VELOCITY = 0, 3  # 3 each, m, m/s
ATTITUDE = 6  # 4, quaternion w x y z, NED from FRD
EULER = 10  # 3, rad: roll, pitch, yaw
RATE = 13  # 3, rad/s
ACCELERATION = 16  # 3, m/s^2, what the accelerometer shows
GYRO = 19  # 3, rad/s, what the gyroscope shows
LENGTH = 22
