"""Indices of the planner's parameter row: `row[params_row.contact.speed]`.

One name for each group of `PlannerParams`, in its order. The row has 2 * COUNT entries: the parameters, then the same
with the values for steep boards.
"""

from __future__ import annotations

from policies.planner import groups
from policies.planner.row_index import row_index, row_length

vehicle = row_index(groups.Vehicle)
contact = row_index(groups.Contact, after=vehicle)
terminal = row_index(groups.Terminal, after=contact)
search = row_index(groups.Search, after=terminal)
weights = row_index(groups.Weights, after=search)
prediction = row_index(groups.Prediction, after=weights)
commit = row_index(groups.Commit, after=prediction)
follow = row_index(groups.Follow, after=commit)
tracking = row_index(groups.Tracking, after=follow)
run_up = row_index(groups.RunUp, after=tracking)
glide = row_index(groups.Glide, after=run_up)
COUNT = row_length(glide)
