"""Indices of the motion predictor's workspace, (DIM,) float32: inputs, the two hidden layers, outputs."""

from policies.prediction import net_row

INPUT = 0
HIDDEN1 = net_row.INPUTS
HIDDEN2 = HIDDEN1 + net_row.HIDDEN1
OUTPUT = HIDDEN2 + net_row.HIDDEN2  # speeds, then turn rates at the knots, then the log of the speed error
DIM = OUTPUT + net_row.OUTPUTS
