"""Compilation of all kernels: `njit` with an on-disk cache that notices changes in called functions.

Numba's own cache looks only at the file a function stands in: change a helper in another file and callers keep the
old machine code. The cache stamp here covers every kernel file that a module reaches.

Numba's cache is not made for a dozen processes that compile at the same time either. Its index and its data are two
files, which two writers can leave inconsistent; and machine code compiled by two processes can have the same symbol, of
which the loader takes the first. Here a file holds one function for one signature and the stamp of its source, and
each process numbers its symbols from a random start.
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import itertools
import os
import pickle
import shutil
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from numba.core import bytecode, caching

from kernel.interrupts import defer_interrupts

__all__ = ["CACHE_DIR", "is_compiled", "keeps_compiled", "njit", "prange"]

CACHE_DIR = Path(
    os.environ.get("PERCH_KERNEL_CACHE", Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "perch-hil")
)
_OURS = "_perch_kernel"  # marks what was compiled by `njit` below, wherever it stands: benchmarks and tests too
_PACKAGES = ("kernel", "groundcar", "vehicle", "policies", "hil")

prange = numba.prange
bytecode.FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(5), "big"))  # type: ignore[attr-defined]


def njit(*args: Any, **options: Any) -> Any:
    """`numba.njit`, cached on disk, with IEEE division (no exception checks) and without fastmath."""
    options = {"cache": True, "error_model": "numpy", **options}
    compiled: Any = numba.njit(**options)

    def kernel(function: Any) -> Any:
        setattr(function, _OURS, True)
        dispatcher = compiled(function)
        cache = getattr(dispatcher, "_cache", None)
        if isinstance(cache, caching.Cache):
            if isinstance(cache._impl.locator, CacheLocator):
                cache._cache_file = CacheFile(cache._cache_file)  # type: ignore[assignment]
            else:  # Numba's own stamp covers one file only
                dispatcher._cache = caching.NullCache()
        return dispatcher

    return kernel(*args) if args else kernel


@functools.cache
def _folder() -> Path:
    """CACHE_DIR where it can be written and is this user's own; else a temporary folder of this process, announced."""
    try:
        CACHE_DIR.mkdir(parents=True, exist_ok=True)
        if CACHE_DIR.stat().st_uid != os.geteuid():
            raise PermissionError(f"{CACHE_DIR} belongs to another user")
        with tempfile.TemporaryFile(dir=CACHE_DIR):
            return CACHE_DIR
    except OSError as error:
        print(
            f"kernels are compiled anew in every process: {error}; set PERCH_KERNEL_CACHE to a folder", file=sys.stderr
        )
        folder = Path(tempfile.mkdtemp(prefix="perch-hil-kernels-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        return folder


def is_compiled(kernel: Any) -> bool:
    """Whether machine code of `kernel`, made by `njit`, is on disk for its present source; also if Numba is off."""
    stats = getattr(kernel, "stats", None)
    return stats is None or any(Path(stats.cache_path).glob(f"*.{kernel.__name__}-*.nbc"))


def keeps_compiled() -> bool:
    """Whether what one process compiles is there for the next."""
    return _folder() == CACHE_DIR


def _reached(module: ModuleType, seen: dict[str, ModuleType]) -> dict[str, ModuleType]:
    if module.__name__ not in seen:
        seen[module.__name__] = module
        if module.__name__ == __name__:  # its globals depend on what was imported before
            return seen
        for value in list(vars(module).values()):
            name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
            if isinstance(name, str) and name.split(".")[0] in _PACKAGES and name in sys.modules:
                _reached(sys.modules[name], seen)
    return seen


class CacheLocator(caching._CacheLocator):
    """Numba cache locator: a folder under CACHE_DIR named by the content of every kernel file the module reaches.

    Two checkouts with the same code share it; code that differs in one byte has another.
    """

    def __init__(self, py_func: Any) -> None:
        module = sys.modules[py_func.__module__]
        digest = hashlib.sha256(numba.__version__.encode())
        for name, reached in sorted(_reached(module, {}).items()):
            if reached.__file__:
                digest.update(f"\n{name}\n".encode() + Path(reached.__file__).read_bytes())
        self._stamp = digest.hexdigest()
        self._name = py_func.__qualname__
        self._dir = _folder() / f"{module.__name__}-{self._stamp[:16]}"

    def get_cache_path(self) -> str:  # type: ignore[override]
        return str(self._dir)

    def get_source_stamp(self) -> str:  # type: ignore[override]
        return self._stamp

    def get_disambiguator(self) -> str:  # type: ignore[override]
        return self._name

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> CacheLocator | None:
        if not hasattr(py_func, _OURS) or py_func.__module__ not in sys.modules:
            return None
        locator = cls(py_func)
        locator.ensure_cache_path()
        return locator


class CacheFile:
    """Where a function's machine code lies, in place of Numba's index and data: a file a signature, replaced whole."""

    def __init__(self, numbas: Any) -> None:
        self._numbas = numbas

    def _path(self, key: Any) -> Path:
        name = self._numbas._index_name.removesuffix(".nbi")
        return Path(self._numbas._data_path(f"{name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"))

    def save(self, key: Any, data: Any) -> None:
        with self._numbas._open_for_write(str(self._path(key))) as file:
            pickle.dump(self._numbas._source_stamp, file)
            file.write(self._numbas._dump(data))

    def load(self, key: Any) -> Any:
        try:
            with self._path(key).open("rb") as file:
                if os.fstat(file.fileno()).st_uid != os.geteuid():  # a pickle of another user's could run anything
                    return None
                if pickle.load(file) == self._numbas._source_stamp:
                    return pickle.load(file)
        except (OSError, EOFError, pickle.UnpicklingError):
            pass
        return None

    def flush(self) -> None:
        for path in self._path("").parent.glob(self._numbas._index_name.removesuffix(".nbi") + ".*.nbc"):
            path.unlink(missing_ok=True)


caching.CacheImpl._locator_classes.insert(0, CacheLocator)
defer_interrupts()
