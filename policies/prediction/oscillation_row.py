"""Indices of a fit of an oscillating speed, (DIM,) float64 (policies.prediction.speed_history)."""

OMEGA = 0  # rad/s
COSINE, SINE = 1, 2  # m/s, amplitudes; phase 0 is at the newest entry used
TRUST = 3  # 0..1
SURPRISE = 4  # m/s, rms error of predicting the newest past; UNKNOWN while the history is short
CONSTANT = 5  # m/s
SINCE = 6  # s from phase 0 to now; the caller that predicts with the fit writes it
DIM = 7
