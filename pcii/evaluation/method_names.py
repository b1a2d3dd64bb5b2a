"""Methods of an evaluation by name: removal by its own, estimators of depth as depth:NAME."""

from pcii.base.errors import InputError
from pcii.depth.methods import BUILT_IN, DEFAULT_METHOD, FOR_COUNTS, FOR_VIEWS, depth_methods
from pcii.removal.methods import removal_methods

DEPTH = "depth"
"""Asks for the default estimator of depth, which has its full name in rows."""
_PREFIX = f"{DEPTH}:"


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


def full_name(method: str, *, full_light: bool) -> str | None:
    """Full name of a method that takes radiance (`full_light`) or photon counts; None if it does not.

    >>> full_name("depth", full_light=False), full_name("depth", full_light=True)
    ('depth:posterior', 'depth:posterior')
    >>> full_name("likelihood", full_light=True) is None
    True
    """
    known = methods_for(full_light=full_light)
    if method == DEPTH:
        return depth_name(DEFAULT_METHOD)
    return method if method in known else None


def check_method(method: str) -> None:
    """Raise `InputError`, listing the known names, for a method that takes no data at all."""
    known = dict.fromkeys(name for kind in (False, True) for name in methods_for(full_light=kind))
    if method not in (*known, DEPTH):
        raise InputError(f"method: there is no method named {method!r}; use {DEPTH}, {', '.join(known)}")
