"""Indices of what is kept of an ended episode, (DIM,): the contact result (policies/task/contact.py), then these."""

from policies.task import result_row

STEPS, SEEN, RHO, RETURN, SPEED, INCLINATION, FAMILY, LAW, ERROR = range(result_row.DIM, result_row.DIM + 9)
DIM = result_row.DIM + 9
