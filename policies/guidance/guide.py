"""Guidance of the last half second: three laws on any policy's command, for any airframe, in flight and in training.

The laws act in this order, each on what the one before has left. Outside its condition a law changes nothing.

| | 1 ALIGNED | 2 FLARED | 3 BRAKED |
|---|---|---|---|
| law | terminal attitude alignment | time-to-go flare | impact-speed limit |
| file | `alignment.py` | `flare.py` | `impact.py` |
| contact in at most | `align_within` | `flare_within`, under full braking thrust | `impact_within` |
| height of the contact disc | any | above the board | above the board |
| closing speed | `align_closing` or more | `flare_closing` or more | above `impact_speed` |
| cosine of body z and normal | `align_cosine` or more | 0 or more | `impact_cosine` or more |
| offset from the centre at most | `align_offset` | `flare_offset` | `impact_offset` |
| and | predicted misalignment | the rest of the turn needs | slides less than `sliding_high`, |
| | beyond `align_band` | a mean rate over `flare_rate` | surface sigma below `sigma_high` |
| changes | roll and pitch rate | roll and pitch rate, in place of 1 | thrust, upwards only |
| within | `rate_max` either way | `rate_max` either way | `thrust_max` |

The yaw rate is never changed. A number that is not finite, in any input or in the result, leaves the whole command as
it was asked, and the flag NOT_FINITE says so: the safety gate comes after guidance and judges such a command.

"Previous command" is what was flown last, guided if it was guided. The same command drives the estimate of the thrust
gain, and it is the previous action of the next observation: a policy receives the command that was flown, in flight
(`policies/flying/guided.py`) as in training (`policies/environment/step.py`).
"""

from __future__ import annotations

import math

from kernel.jit import njit
from policies.guidance.alignment import align, lean_now
from policies.guidance.flare import flare
from policies.guidance.impact import limit_impact

ALIGNED, FLARED, BRAKED, NOT_FINITE = 1, 2, 4, 8  # bits of what `guide` returns
LAWS = {ALIGNED: "terminal attitude alignment", FLARED: "time-to-go flare", BRAKED: "impact-speed limit"}


@njit
def _finite(row):
    total = 0.0
    for k in range(row.shape[0]):
        total += 0.0 * row[k]  # NaN for every number that is not finite
    return total == 0.0


@njit
def guide(command, p, v, q, board, sigma, previous, gain, drag, g):
    """Apply the laws to `command` ((4,): body rate FLU rad/s, thrust m/s^2) in place. Returns the bits of what acted.

    `p` m, `v` m/s (3,) world, `q` (4,) world from body: the vehicle now, by its own estimate; `board` (8,) the believed
    board now; `sigma` m of its surface along its normal; `previous` (4,) the command flown last; `gain`: achieved over
    asked thrust; `drag` 1/s; `g` (gp.COUNT,) row of GuidanceParams.
    """
    known = _finite(command) and _finite(p) and _finite(v) and _finite(q) and _finite(board) and _finite(previous)
    if not known or not math.isfinite(sigma + gain + drag):
        return NOT_FINITE
    roll, pitch, thrust = command[0], command[1], command[3]
    lean = lean_now(board, sigma, g)
    acted = 0
    if align(p, v, q, board, sigma, lean, previous, g, command):
        acted |= ALIGNED
    if flare(p, v, q, board, lean, previous, gain, g, command):
        acted |= FLARED
    if limit_impact(p, v, q, board, sigma, previous, gain, drag, g, command):
        acted |= BRAKED
    if not _finite(command):
        command[0], command[1], command[3] = roll, pitch, thrust
        return NOT_FINITE
    return acted
