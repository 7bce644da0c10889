"""The planner's phases, as a row holds them and by the names that are recorded.

- hold: no valid belief; it hovers.
- follow: it keeps station behind and above the board, or at the start of the run-up.
- run-up: the accelerated approach to a board too steep for its speed; it ends where the flare begins (`runup.py`).
- commit: it flies a planned motion to contact and plans anew at every `Search.period`.
- terminal: it flies the last plan to its end.
- glide: the planless approach to a flat board (`glide.py`).
- go-around: it climbs away from a missed board.
"""

from __future__ import annotations

HOLD, FOLLOW, COMMIT, TERMINAL, AROUND, RUN_UP, GLIDE = range(7)
PHASES = ("hold", "follow", "commit", "terminal", "go_around", "run_up", "glide")
