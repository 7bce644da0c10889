"""What was asked for is read and checked before anything is written."""

import pytest

from hil.assembly.plan import Plan
from hil.assembly.rig import list_rigs


@pytest.mark.parametrize("rig", sorted(list_rigs()))
def test_every_shipped_rig_flies_its_default_policy(rig):
    plan = Plan("simple-i", rig, None, None)
    assert plan.policy_name == plan.rig.policy.kind
    assert plan.make_policy()
