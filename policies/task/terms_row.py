"""Indices of a row of reward terms, (DIM,) float64; the reward is their sum."""

GUIDE, ALIGN, ACT, AGGR, TIME, ESTIMATE, PERCEPTION, TERMINAL, IMPACT = 0, 1, 2, 3, 4, 5, 6, 7, 8
DIM = 9
