"""Methods of an evaluation by name: removal by its own, estimators of depth as depth:NAME.

A function, which nobody has registered, is one of removal, or of depth where it is given as a pair
("depth:NAME", function).
"""

from collections.abc import Callable, Collection, Sequence
from typing import Any

from pcii.base.errors import InputError
from pcii.base.extensions import load_function, name_of
from pcii.depth.methods import BUILT_IN, DEFAULT_METHOD, FOR_COUNTS, FOR_VIEWS, depth_methods
from pcii.removal.methods import removal_methods

DEPTH = "depth"
"""Asks for the default estimator of depth, which has its full name in rows."""
_PREFIX = f"{DEPTH}:"
Function = Callable[..., Any]
Method = str | Function | tuple[str, Function]
"""What may be given as a method: a name, a removal, or a name and a function."""


def depth_name(estimator: str) -> str:
    """Name of an estimator of depth among all methods.

    >>> depth_name("posterior")
    'depth:posterior'
    """
    return _PREFIX + estimator


def estimator_of(method: str) -> str | None:
    """The estimator of depth that a method's full name means; None for a removal.

    >>> estimator_of("depth:posterior"), estimator_of("likelihood")
    ('posterior', None)
    """
    return method.removeprefix(_PREFIX) if method.startswith(_PREFIX) else None


def methods_for(*, full_light: bool) -> tuple[str, ...]:
    """Full names of the methods that take radiance (`full_light`) or photon counts: removal, then depth.

    >>> methods_for(full_light=True)
    ('depth:posterior', 'depth:variance-sweep', 'depth:structure-tensor')
    """
    others = [name for name in depth_methods() if name not in BUILT_IN]
    estimators = [*(FOR_VIEWS if full_light else FOR_COUNTS), *others]
    removal = () if full_light else removal_methods()
    return (*removal, *map(depth_name, estimators))


def named_functions(methods: Sequence[Method]) -> dict[str, Function | None]:
    """The methods by their names, with the function of those that are given as one.

    Raises `InputError` for an unknown name, and for a function by a name that is taken.

    >>> named_functions(["likelihood", ("all", lambda counts, sections: sections.counts > 0)]).keys()
    dict_keys(['likelihood', 'all'])
    """
    found: dict[str, Function | None] = {}
    for method in methods:
        if isinstance(method, str) and ":" in (estimator_of(method) or method):
            function = load_function(estimator_of(method) or method)
            name = name_of(function)
            method = (name if estimator_of(method) is None else depth_name(name)), function
        if isinstance(method, str):
            check_method(method)
            found.setdefault(method)
            continue
        name, function = method if isinstance(method, tuple) else (name_of(method), method)
        if not isinstance(name, str) or not callable(function):
            raise InputError(f"methods: expected names, functions, or pairs (name, function), got {method!r}")
        if name in found or name in _all_names():
            raise InputError(f"methods: the name {name!r} is taken; give a pair (another name, function)")
        found[name] = function
    return found


def full_name(method: str, *, full_light: bool, functions: Collection[str] = ()) -> str | None:
    """Full name of a method that takes radiance (`full_light`) or photon counts; None if it does not.

    `functions` are the names of methods that are given as a function. Those of depth take both.

    >>> full_name("depth", full_light=False), full_name("depth", full_light=True)
    ('depth:posterior', 'depth:posterior')
    >>> full_name("likelihood", full_light=True) is None
    True
    """
    if method == DEPTH:
        return depth_name(DEFAULT_METHOD)
    if method in functions:
        return None if full_light and estimator_of(method) is None else method
    return method if method in methods_for(full_light=full_light) else None


def check_method(method: str) -> None:
    """Raise `InputError`, listing the known names, for a method that takes no data at all."""
    known = _all_names()
    if method not in known:
        raise InputError(f"method: there is no method named {method!r}; use {', '.join(known)}")


def _all_names() -> list[str]:
    names = dict.fromkeys(name for kind in (False, True) for name in methods_for(full_light=kind))
    return [DEPTH, *names]
