"""Methods of an evaluation by name: methods of removal by theirs, estimators of depth as depth:NAME.

A function that is not registered is named "module:function" or "file.py:function", with "depth:" before
it for depth; in Python the function itself stands for it, or a pair of a name and the function.

After `depth:` no name has a colon, so that a full name says which of the two a method is; and none has
brackets, since tables name in parentheses what is no method. A submission to the benchmark names one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, StringConstraints, ValidationError, model_validator

from pcii.base import InputError, is_plain, load_function, name_of
from pcii.depth import BUILT_IN, DEFAULT_METHOD, FOR_COUNTS, FOR_VIEWS, depth_methods
from pcii.depth import methods as depth
from pcii.removal import methods as removal
from pcii.removal import removal_methods
from pcii.store import Half, first_fault, own_software, software_with

DEPTH = "depth"
"""Names the default estimator of depth, which has its full name in rows."""
_PREFIX = f"{DEPTH}:"
_NOT_IN_NAMES = frozenset(":()[]{}")
Function = Callable[..., Any]
Method = str | Function | tuple[str, Function]
"""What may be given as a method: a name, a removal, or a name and a function."""
SUBMISSION = "submission.json"
Made = Literal["run by pcii benchmark run", "scored from maps by pcii benchmark score"]
RUN, SCORED = get_args(Made)
Text = Annotated[str, StringConstraints(min_length=1)]
AnySubmission = TypeVar("AnySubmission", bound="Submission")


@dataclass(frozen=True)
class NamedMethod:
    """A method by its full name, and its function if it is not registered.

    `source` is the "module:function" or "file.py:function" that it was loaded from.
    """

    name: str
    function: Function | None = None
    source: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        # Another process loads the function from its source: modules of files cannot be sent.
        if self.source:
            return named_method, (self.source,)
        return NamedMethod, (self.name, self.function)

    def takes(self, *, full_light: bool) -> bool:
        """Whether it takes radiance (`full_light`) or photon counts; functions of depth take both."""
        if self.function is not None:
            return not full_light or estimator_of(self.name) is not None
        return self.name in methods_for(full_light=full_light)


def software_of(method: NamedMethod) -> dict[str, str] | None:
    """All software that the result of a method follows from: versions, and hashes of sources.

    For a method of another package this is also the source of that package: every file, so also the weights
    of a network. None for a function that has no source.
    """
    estimator = estimator_of(method.name)
    if method.source:
        return software_with((estimator_of(method.source) or method.source).rpartition(":")[0])
    if method.function is not None:
        return None
    registry, name = (removal, method.name) if estimator is None else (depth, estimator)
    point = registry.REGISTRY.point_of(name)
    return own_software() if point is None else software_with(point.module)


def depth_name(estimator: str) -> str:
    """Name of an estimator of depth among all methods, such as "depth:posterior"."""
    return _PREFIX + estimator


def estimator_of(method: str) -> str | None:
    """The estimator of depth that a method's full name means; None for a removal."""
    return method.removeprefix(_PREFIX) if method.startswith(_PREFIX) else None


def methods_for(*, full_light: bool) -> tuple[str, ...]:
    """Full names of the methods that take radiance (`full_light`) or photon counts: removal, then depth."""
    others = [name for name in depth_methods() if name not in BUILT_IN]
    estimators = [*(FOR_VIEWS if full_light else FOR_COUNTS), *others]
    removal = () if full_light else removal_methods()
    return (*removal, *map(depth_name, estimators))


def known_methods() -> list[str]:
    """Full names of all methods."""
    return list(dict.fromkeys(name for kind in (False, True) for name in methods_for(full_light=kind)))


def named_methods(methods: Sequence[Method]) -> list[NamedMethod]:
    """The methods, each once; `InputError` for an unknown name, and for a function by a name that is taken.

    >>> [method.name for method in named_methods(["depth", ("all", lambda counts, sections: None)])]
    ['depth:posterior', 'all']
    """
    by_name: dict[str, NamedMethod] = {}
    for method in map(named_method, methods):
        if by_name.setdefault(method.name, method) != method:
            raise InputError(f"methods: {method.name!r} is there twice; give a pair (another name, function)")
    return list(by_name.values())


def named_method(method: Method) -> NamedMethod:
    """A method by its full name; raises `InputError` as `named_methods` does."""
    if not isinstance(method, str):
        name, function = method if isinstance(method, tuple) else (name_of(method), method)
        if not isinstance(name, str) or not callable(function):
            raise InputError(f"methods: expected names, functions, or pairs (name, function), got {method!r}")
        _check_name(name, "methods")
        return NamedMethod(name, function)
    if method == DEPTH:
        return NamedMethod(depth_name(DEFAULT_METHOD))
    if method in known_methods():
        return NamedMethod(method)
    estimator = estimator_of(method)
    source = method if estimator is None else estimator
    if ":" not in source:
        known = ", ".join([DEPTH, *known_methods()])
        raise InputError(f"method: there is no method named {method!r}; use {known}, or module:function")
    function = load_function(source)
    name = name_of(function) if estimator is None else depth_name(name_of(function))
    _check_name(name, "methods")
    return NamedMethod(name, function, method)


def _check_name(name: str, label: str, *, may_be_known: bool = False) -> None:
    """Raise `InputError`, which begins with `label`, for a full name that could be taken for another one.

    All of it is seen (`is_plain`), it has no colon but that of `depth:`, and no bracket. It differs from
    those of known methods by more than case, or else, if it `may_be_known`, is one of them.
    """
    short_name = name.removeprefix(_PREFIX)
    if not is_plain(short_name) or not short_name or _NOT_IN_NAMES & {*short_name}:
        raise InputError(
            f"{label}: expected a name of characters that are seen and single blanks, without colons and "
            f"brackets, in Unicode's form NFKC, got {short_name!a}"
        )
    known = known_methods()
    if may_be_known and name in known:
        return
    if name.casefold() in {other.casefold() for other in (DEPTH, *known)}:
        raise InputError(f"{label}: the name {name!r} is taken; choose another one")


class Submission(BaseModel):
    """What submission.json says: the benchmark, the name of the method, and more if its authors like.

    The name is without `depth:`, and new for masks and for depth. The page shows `url` as text, no link.
    """

    model_config = ConfigDict(extra="forbid")

    benchmark: Text
    method: Text
    authors: Text | None = None
    url: Annotated[str, StringConstraints(pattern="^https?://")] | None = None
    description: Text | None = None
    trained_on: Text | None = None

    @property
    def is_run(self) -> bool:
        """Whether the method was run here, and its maps not made elsewhere."""
        return False

    @property
    def methods(self) -> tuple[str, ...]:
        """Full names of what may be scored: of the one method that was run, or of depth and masks in maps."""
        return (self.method,) if self.is_run else (depth_name(self.method), self.method)

    @model_validator(mode="after")
    def _has_good_names(self) -> Self:
        for name in self.methods:
            _check_name(name, "method", may_be_known=self.is_run)
        return self


class ScoredSubmission(Submission):
    """What the submission.json of a folder of scores says; a method that was run has its full name there."""

    made: Made
    command_name: Text | None = None
    half: Half

    @property
    def is_run(self) -> bool:
        """Whether the method was run here, and its maps not made elsewhere."""
        return self.made == RUN


def read_submission(folder: Path, model: type[AnySubmission]) -> AnySubmission:
    """What submission.json says in a folder; raises `InputError` if it is missing or wrong."""
    file, expected = folder / SUBMISSION, f"expected a JSON object of {', '.join(model.model_fields)}"
    if not file.is_file() or not file.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"{file}: missing, or a link out of the folder; {expected}")
    try:
        return model.model_validate_json(file.read_bytes())
    except ValidationError as fault:
        raise InputError(f"{file}: {first_fault(fault)}; {expected}") from None
