"""The nodes that know and decide: belief and policy of the vehicle, director and referee of the run."""

from __future__ import annotations

from hil.assembly.parts import Parts
from hil.nodes.belief import BeliefNode, MocapBeliefNode
from hil.nodes.director import Director
from hil.nodes.policy import PolicyNode
from hil.nodes.referee import Referee
from policies.estimation.board_filter import BoardFilter
from policies.task.contact import ContactRules

PREPARE_LIMIT_NS = 90_000_000_000
PREPARE_LIMIT_REAL_NS = 130_000_000_000  # a SITL lags behind wall time


def belief(parts: Parts) -> BeliefNode:
    node = MocapBeliefNode if parts.rig.policy.knows == "mocap" else BeliefNode
    return node(BoardFilter())


def policy(parts: Parts) -> PolicyNode:
    return PolicyNode(parts.make_policy())


def director(parts: Parts) -> Director:
    limit_ns = PREPARE_LIMIT_NS if parts.rig.vehicle.kind in ("sim", "crazyflie-sim") else PREPARE_LIMIT_REAL_NS
    return Director(round(parts.scenario.car.lead * 1e9), limit_ns)


def referee(parts: Parts) -> Referee:
    """With the scenario's tolerances, attachment and workspace, and the airframe's contact disc."""
    tolerance, space, holds = parts.scenario.tolerance, parts.scenario.workspace, parts.scenario.attachment
    rules = ContactRules(
        delta_d=tolerance.distance,
        delta_v=tolerance.tangential_speed,
        delta_theta=tolerance.angle,
        ground_z=space.z[0],
        workspace_xy=max(abs(limit) for limit in (*space.x, *space.y)),
        workspace_z=space.z[1],
        time_limit=parts.scenario.time_limit,
        magnet_normal_error=holds.normal_error,
        magnet_tangential=holds.tangential_speed,
        magnet_normal_min=holds.impact_speed[0],
        magnet_normal_max=holds.impact_speed[1],
    )
    return Referee(rules, parts.frame.contact, None if parts.scenario.tilts else parts.inclination)
