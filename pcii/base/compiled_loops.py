"""Compilation of loops with Numba, which needs no system library, and their threads.

Numba is imported where the first loop runs, since that takes longer than importing the rest of the package.
Compiled code is cached on disk, so each loop is compiled once per machine. Threads share
loops by ranges of their outermost index: Numba's own parallel loops take twice as long to compile, and their
OpenMP threads do not survive a fork.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, wraps
from types import FunctionType
from typing import Any, TypeVar

from pcii.base.executor import threads_of_worker

Item = TypeVar("Item")
Result = TypeVar("Result")

PARTS_PER_THREAD = 4
"""Ranges per thread: who is done early takes one more. Results do not depend on it."""

_threads: int | None = None
_helpers = set[FunctionType]()


def helper(function: Any) -> Any:
    """Decorator of a function that only compiled functions of its module call."""
    _helpers.add(function)
    return function


def compiled(function: Callable[..., Result]) -> Callable[..., Result]:
    """Decorator of a function that is compiled when it is called for the first time."""

    @wraps(function)
    def run(*arguments: Any) -> Result:
        return _compiled(function)(*arguments)

    return run


@cache
def _compiled(function: Any) -> Any:
    names, options = function.__globals__, {"nogil": True, "cache": True}
    for name, value in list(names.items()):
        # Numba finds helpers among the names of the loop's module, and wants them compiled there. They have
        # no entry from Python, which would take time to compile.
        if isinstance(value, FunctionType) and value in _helpers:
            names[name] = _numba().njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)(value)
    return _numba().njit(**options)(function)


@cache
def _numba() -> Any:
    import numba

    # It runs what its cache holds; a .numba_config.yaml in the working directory may not say where that is.
    numba.config.CACHE_DIR = os.environ.get("NUMBA_CACHE_DIR", "")  # type: ignore[attr-defined]
    return numba


def in_threads(loop: Callable[..., Any], count: int, *arguments: Any) -> list[Any]:
    """Results of `loop(first, last, *arguments)` for ranges that share 0 .. `count` - 1.

    The loop is compiled, or spends its time in a library that lets other threads run. Results come in the
    order of the ranges; how many there are depends on the number of threads.
    """
    parts = min(count, PARTS_PER_THREAD * threads()) if threads() > 1 else 1
    if parts <= 1:
        return [loop(0, count, *arguments)]
    ends = [count * part // parts for part in range(parts + 1)]
    return each_in_threads(lambda part: loop(ends[part], ends[part + 1], *arguments), range(parts))


def each_in_threads(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """`function` of each item, in their order; threads take one item at a time, this one among them."""
    results: list[Any] = [None] * len(items)
    waiting = iter(range(len(items)))

    def work() -> None:
        for place in waiting:
            results[place] = function(items[place])

    others = [_thread_pool(threads()).submit(work) for _ in range(min(threads(), len(items)) - 1)]
    work()
    for other in others:
        if not other.cancel():  # it had not begun: all is done
            other.result()
    return results


def shared(count: Callable[..., int]) -> Callable[[Callable[..., Result]], Callable[..., list[Result]]]:
    """Decorator of a loop `loop(first, last, *arguments)`: compiled, called as `loop(*arguments)`.

    Threads share the indices from 0 to `count(*arguments)` - 1 (see `in_threads`).
    """

    def decorate(loop: Callable[..., Result]) -> Callable[..., list[Result]]:
        @wraps(loop)
        def run(*arguments: Any) -> list[Result]:
            return in_threads(_compiled(loop), count(*arguments), *arguments)

        return run

    return decorate


def use_threads(count: int) -> None:
    """Set the number of threads that run loops of this process, up to what Numba is allowed (the cores)."""
    global _threads
    _threads = count


def threads() -> int:
    """Number of threads that share a loop: all cores, a worker's share of them, or that of `use_threads`."""
    allowed: int = _numba().config.NUMBA_NUM_THREADS
    return min(_threads or threads_of_worker() or allowed, allowed)


@cache
def _thread_pool(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, "loops")


os.register_at_fork(after_in_child=_thread_pool.cache_clear)  # a pool's threads stay behind in the parent
