"""Indices of the rows of the simulated sensors. FRD, SI units but where HIL_SENSOR has others."""

# What HIL_SENSOR carries, in its order:
ACCEL, GYRO, MAG = 0, 3, 6  # 3 each: m/s^2, rad/s, gauss
PRESSURE, DIFFERENTIAL, PRESSURE_ALTITUDE, TEMPERATURE = 9, 10, 11, 12  # hPa, hPa, m, deg C
READING_LENGTH = 13

# Standard deviations of one sample, and of what is drawn once a flight:
ACCEL_SIGMA, GYRO_SIGMA, MAG_SIGMA, PRESSURE_SIGMA = 0, 1, 2, 3  # m/s^2, rad/s, gauss, Pa
ACCEL_BIAS, GYRO_BIAS, MAG_BIAS, PRESSURE_BIAS = 4, 5, 6, 7
GPS_SIGMA, GPS_TAU, GPS_VELOCITY_SIGMA = 8, 9, 10  # m, s, m/s
NOISE_LENGTH = 11

# Biases that were drawn: 3 each, then the barometer's (Pa), then the position error of GPS (3, m).
BIAS_ACCEL, BIAS_GYRO, BIAS_MAG, BIAS_PRESSURE, GPS_ERROR = 0, 3, 6, 9, 10
ERROR_LENGTH = 13
