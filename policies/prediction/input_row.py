"""Indices of the motion predictor's input row, (DIM,) float32: the history at each tap, then the belief now."""

LAGS = (*range(16), *range(17, 48, 2), *range(52, 98, 5))  # entries of the history looked at: all of 0.8 s, then fewer
TAPS = len(LAGS)

SPEED, TURN_RATE, ACCELERATION = 0, 1, 2  # from a tap's first number: 0.5 s/m, rad/s, 0.5 s^2/m
AGE = 3  # s, of the newest exposure
ALONG, ACROSS = 4, 5  # half the mean velocity to the next tap, m/s, in the board's frame now
CHANNELS = 6

NOW = TAPS * CHANNELS  # the belief now: SPEED to AGE as above, then
SIGMA, SPEED_SIGMA = 4, 5  # from NOW: 0.1 m, 0.5 m/s
STREAK = 6  # from NOW: 40 measurements
SINCE = 7  # from NOW: time since the newest entry, 0.05 s
DIM = NOW + 8
