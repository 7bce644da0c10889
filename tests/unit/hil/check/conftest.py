"""A simulated rig to check."""

import pytest

from tests.unit.hil.check.made_up import context as make_context


@pytest.fixture
def context(tmp_path):
    return make_context(tmp_path)


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    return make_context(tmp_path_factory.mktemp("out"))
