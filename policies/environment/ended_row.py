"""Indices of what is kept of an ended episode, (DIM,): the contact result (policies/task/contact.py), then these."""

from policies.task.contact import RESULT_DIM

STEPS, SEEN, RHO, RETURN, SPEED, INCLINATION, FAMILY, LAW, ERROR = range(RESULT_DIM, RESULT_DIM + 9)
DIM = RESULT_DIM + 9
