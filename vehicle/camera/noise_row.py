"""Indices of a noise row, (DIM,) float64: three channels of the visual observation noise, then the two biases."""

LATERAL, DEPTH, ROTATION = 0, 6, 12  # first number of each channel
SIGMA, K1, K2, K3, K4, K5 = 0, 1, 2, 3, 4, 5  # from a channel's first number; sigmas in m, m, rad
BIAS_POSITION, BIAS_ROTATION = 18, 19  # m, rad
DIM = 20
