"""The kernel cache must notice a change in a callee that stands in another file: Numba's own does not."""

import os
import shutil
import subprocess
import sys
import textwrap

import pytest

from tests.paths import ROOT

CALLER = "from kernel.jit import njit\nfrom vehicle.helper import gain\n\n@njit\ndef caller(x):\n    return gain(x)\n"
HELPER = "from kernel.jit import njit\n\n@njit\ndef gain(x):\n    return {} * x\n"


@pytest.fixture
def package(tmp_path):
    """A stand-in for the vehicle package beside the real kernel package, with its own cache."""
    (tmp_path / "vehicle").mkdir()
    (tmp_path / "vehicle" / "__init__.py").write_text("")
    (tmp_path / "vehicle" / "caller.py").write_text(CALLER)
    (tmp_path / "kernel").symlink_to(ROOT / "kernel")

    def run(module="vehicle.caller", **environment):
        code = f"""
            from {module} import caller
            print(caller(1.0), getattr(caller, "stats", None) and sum(caller.stats.cache_hits.values()))
        """
        environment = {**os.environ, "PERCH_KERNEL_CACHE": str(tmp_path / "cache"), "PYTHONPATH": "", **environment}
        return subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()

    return tmp_path / "vehicle" / "helper.py", run


def test_a_changed_callee_is_recompiled_and_an_unchanged_one_is_not(package):
    helper, run = package
    helper.write_text(HELPER.format(2.0))
    assert run() == ["2.0", "0"]
    assert run() == ["2.0", "1"]
    helper.write_text(HELPER.format(3.0))
    assert run() == ["3.0", "0"]


def test_a_changed_callee_outside_the_project_s_packages_is_recompiled(package):
    helper, run = package
    (helper.parents[1] / "bench.py").write_text(CALLER)
    helper.write_text(HELPER.format(2.0))
    assert run("bench") == ["2.0", "0"]
    assert run("bench") == ["2.0", "1"]
    helper.write_text(HELPER.format(3.0))
    assert run("bench") == ["3.0", "0"]


def test_processes_that_compile_concurrently_do_not_share_code(package):
    helper, _ = package
    helper.write_text(HELPER.format(2.0))
    sums = (
        "import numpy as np; from vehicle.caller import caller;"
        "print(np.sum(caller({0})), sum(caller.stats.cache_hits.values()))"
    )
    arguments = ["1.0", "1", "np.ones(3)", "np.ones((2, 2))", "1j"]
    environment = {**os.environ, "PERCH_KERNEL_CACHE": str(helper.parents[1] / "cache"), "PYTHONPATH": ""}

    def start(argument):
        command = [sys.executable, "-c", sums.format(argument)]
        return subprocess.Popen(command, cwd=helper.parents[1], env=environment, stdout=subprocess.PIPE, text=True)

    expected = ["2.0", "2.0", "6.0", "8.0", "2j"]
    for hits in ("0", "1"):
        printed = [one.communicate()[0].split() for one in [start(argument) for argument in arguments]]
        assert printed == [[total, hits] for total in expected]


def test_no_two_processes_give_their_machine_code_the_same_symbols(package):
    helper, _ = package
    helper.write_text(HELPER.format(2.0))
    names = set()
    for place in ("one", "two"):
        code = (
            "from vehicle.caller import caller; caller(1.0);"
            "print(caller.overloads[caller.signatures[0]].fndesc.unique_name)"
        )
        environment = {**os.environ, "PERCH_KERNEL_CACHE": str(helper.parents[1] / place), "PYTHONPATH": ""}
        names.add(subprocess.check_output([sys.executable, "-c", code], cwd=helper.parents[1], env=environment))
    assert len(names) == 2


def test_truncated_cache_file_is_recompiled(package):
    helper, run = package
    helper.write_text(HELPER.format(2.0))
    run()
    for file in (helper.parents[1] / "cache").glob("**/*.nbc"):
        file.write_bytes(file.read_bytes()[:200])
    assert run() == ["2.0", "0"]
    assert run() == ["2.0", "1"]


def test_kernel_cache_is_independent_of_earlier_imports(package):
    helper, run = package
    helper.write_text(HELPER.format(2.0))
    run()
    (helper.parents[1] / "later.py").write_text("import kernel.random\nfrom vehicle.caller import caller\n")
    assert run("later") == ["2.0", "1"]


def test_kernels_run_without_the_compiler(package):
    helper, run = package
    helper.write_text(HELPER.format(2.0))
    assert run(NUMBA_DISABLE_JIT="1")[0] == "2.0"


def test_unwritable_cache_folder_is_reported_and_kernels_recompile(package):
    helper, run = package
    blocked = helper.parents[1] / "file"
    blocked.write_text("no folder")
    for factor in (2.0, 3.0):  # Numba's own cache, beside the source, would keep the first
        helper.write_text(HELPER.format(factor))
        assert run(PERCH_KERNEL_CACHE=str(blocked)) == [str(factor), "0"]
    code = "from vehicle.caller import caller; caller(1.0)"
    environment = {**os.environ, "PERCH_KERNEL_CACHE": str(blocked), "PYTHONPATH": ""}
    command = [sys.executable, "-c", code]
    finished = subprocess.run(
        command, cwd=helper.parents[1], env=environment, capture_output=True, text=True, check=True
    )
    assert "set PERCH_KERNEL_CACHE" in finished.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file to another user")
def test_cached_code_of_another_user_is_not_loaded(package):
    helper, run = package
    helper.write_text(HELPER.format(2.0))
    run()
    for file in (helper.parents[1] / "cache").glob("**/*.nbc"):
        os.chown(file, 12345, 12345)
    assert run() == ["2.0", "0"]


def test_two_checkouts_with_the_same_code_share_their_kernels(package, tmp_path_factory):
    helper, run = package
    helper.write_text(HELPER.format(2.0))
    run()
    other = tmp_path_factory.mktemp("other")
    shutil.copytree(helper.parent, other / "vehicle", ignore=shutil.ignore_patterns("__pycache__"))
    (other / "kernel").symlink_to(ROOT / "kernel")
    code = "from vehicle.caller import caller; caller(1.0); print(sum(caller.stats.cache_hits.values()))"
    environment = {**os.environ, "PERCH_KERNEL_CACHE": str(helper.parents[1] / "cache"), "PYTHONPATH": ""}
    assert subprocess.check_output([sys.executable, "-c", code], cwd=other, env=environment, text=True).strip() == "1"


def test_kernel_is_compiled_if_its_present_source_is(package):
    helper, _ = package
    code = "import kernel.jit; from vehicle.caller import caller; print(kernel.jit.is_compiled(caller)); caller(1.0)"

    def compiled(**more):
        environment = {
            **os.environ, "PERCH_KERNEL_CACHE": str(helper.parents[1] / "cache"), "PYTHONPATH": "", **more,
        }  # fmt: skip
        command = [sys.executable, "-c", code]
        return subprocess.check_output(command, cwd=helper.parents[1], env=environment, text=True).strip()

    helper.write_text(HELPER.format(2.0))
    assert (compiled(), compiled()) == ("False", "True")
    helper.write_text(HELPER.format(3.0))
    assert (compiled(NUMBA_DISABLE_JIT="1"), compiled(), compiled()) == ("True", "False", "True")
