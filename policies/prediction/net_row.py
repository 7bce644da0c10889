"""Indices of a motion predictor, (DIM,) float32: weights and biases of three layers, then the limits of its trust."""

from policies.prediction import input_row

INPUTS = input_row.DIM
HIDDEN1, HIDDEN2 = 128, 96
KNOTS = 13  # horizons at which it answers
OUTPUTS = 2 * KNOTS + 1  # speeds (m/s), turn rates (rad/s), log of the expected speed error (m/s)

W1, B1 = 0, INPUTS * HIDDEN1  # weights (in, out), row-major
W2 = B1 + HIDDEN1
B2 = W2 + HIDDEN1 * HIDDEN2
W3 = B2 + HIDDEN2
B3 = W3 + HIDDEN2 * OUTPUTS
LIMITS = B3 + OUTPUTS
SHORT, LONG = LIMITS, LIMITS + 1  # s of history: trust 0 up to SHORT, 1 from LONG on
FRESH, OLD = LIMITS + 2, LIMITS + 3  # s, age of the newest exposure: trust 1 up to FRESH, 0 from OLD on
DOUBT = LIMITS + 4  # share of the expected speed error in the surprise that the planner is given
DIM = LIMITS + 5
