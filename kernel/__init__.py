"""The one way kernels are compiled here: `njit` with an on-disk cache that notices changes in callees.

Numba's own cache looks only at the file a function stands in: change a helper in another file and callers keep the
old machine code. Flying with that is not acceptable, so the cache stamp here covers every kernel file a module reaches.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from numba.core import caching

__all__ = ["CACHE_DIR", "cache_is_cold", "njit", "prange"]

CACHE_DIR = Path(
    os.environ.get("PERCH_KERNEL_CACHE", Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "perch-hil")
)
_OURS = "_perch_kernel"  # marks what was compiled by `njit` below, wherever it stands: benchmarks and tests too
_PACKAGES = ("kernel", "groundcar", "vehicle", "policies", "hil")

prange = numba.prange


def njit(*args: Any, **options: Any) -> Any:
    """`numba.njit` with the house's settings: cached on disk, IEEE division (no exception checks), no fastmath."""
    options = {"cache": True, "error_model": "numpy", **options}
    compiled: Any = numba.njit(**options)

    def kernel(function: Any) -> Any:
        setattr(function, _OURS, True)
        return compiled(function)

    return kernel(*args) if args else kernel


def cache_is_cold() -> bool:
    """True while no kernel has ever been compiled here: the first run takes a minute longer and should say so."""
    return not any(CACHE_DIR.glob("**/*.nbi"))


def _reached(module: ModuleType, seen: dict[str, ModuleType]) -> dict[str, ModuleType]:
    if module.__name__ not in seen:
        seen[module.__name__] = module
        for value in list(vars(module).values()):
            name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
            if isinstance(name, str) and name.split(".")[0] in _PACKAGES and name in sys.modules:
                _reached(sys.modules[name], seen)
    return seen


class CacheLocator(caching._CacheLocator):
    """Numba cache locator: files under CACHE_DIR, stamped with a hash of every kernel file the module reaches."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._module = sys.modules[py_func.__module__]
        self._name = py_func.__qualname__
        self._dir = CACHE_DIR / hashlib.sha256(str(Path(py_file).resolve()).encode()).hexdigest()[:12]

    def get_cache_path(self) -> str:  # type: ignore[override]
        return str(self._dir)

    def get_source_stamp(self) -> str:  # type: ignore[override]
        digest = hashlib.sha256(numba.__version__.encode())
        for _, module in sorted(_reached(self._module, {}).items()):
            if module.__file__:
                digest.update(Path(module.__file__).read_bytes())
        return digest.hexdigest()

    def get_disambiguator(self) -> str:  # type: ignore[override]
        return self._name

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> CacheLocator | None:
        if not hasattr(py_func, _OURS) or py_func.__module__ not in sys.modules:
            return None
        locator = cls(py_func, py_file)
        try:
            locator.ensure_cache_path()
        except OSError:
            return None
        return locator


caching.CacheImpl._locator_classes.insert(0, CacheLocator)
