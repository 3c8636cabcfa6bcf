"""Every public name says what it is, what its arguments are, and shapes and units where it has arrays."""

import importlib
import inspect
import re
from functools import cached_property
from types import FunctionType

import pytest

ELSEWHERE = re.compile(
    r"\b(?:as|those|arguments|options|values)\b[^.]* (?:of|for|by|see) `[\w.]+`", re.IGNORECASE
)
"""A docstring may leave arguments to the one of another function: "arguments are those of `simulate`"."""

ARRAYS = ("Array", "ndarray", "Integers", "Flags", "Image", "Complex")


def public_names():
    """Names and objects of the package, of its optional parts, and of the environments."""
    for package in ("mjskip", "mjskip.warp", "mjskip.jax"):
        try:
            module = importlib.import_module(package)
        except ImportError:  # an optional package is not there
            continue
        yield from ((f"{package}.{name}", getattr(module, name)) for name in module.__all__)
    pytest.importorskip("gymnasium")
    for name, (module, _) in importlib.import_module("mjskip.envs").ENVIRONMENTS.items():
        for kind in (f"{name}Env", f"{name}VectorEnv"):
            yield f"mjskip.envs.{kind}", getattr(importlib.import_module(module), kind)


def members():
    """All of them but modules and tables, with the methods and properties of the classes."""
    found = {}
    for name, thing in public_names():
        if inspect.ismodule(thing) or not callable(thing):
            continue
        found[name] = thing
        for base in thing.__mro__ if inspect.isclass(thing) else ():
            if base.__module__.startswith("mjskip"):
                for key, value in vars(base).items():
                    kinds = (staticmethod, classmethod, property, cached_property, FunctionType)
                    if not key.startswith("_") and isinstance(value, kinds):
                        found.setdefault(f"{name}.{key}", value)
    return found


MEMBERS = members()


def function_of(thing):
    """What has the signature and the docstring of a member; a class has its `__init__`'s."""
    if isinstance(thing, property):
        return thing.fget
    return getattr(thing, "__func__", getattr(thing, "func", thing))


@pytest.mark.parametrize("name", MEMBERS)
def test_a_public_name_explains_its_arguments_with_shapes_and_units(name):
    thing = function_of(MEMBERS[name])
    text = inspect.getdoc(thing) or ""
    assert text, "has no docstring"
    if inspect.isclass(thing):
        text += inspect.getdoc(thing.__init__) or ""
        for base in thing.__mro__[1:]:
            text += base.__doc__ or "" if base.__module__.startswith("mjskip") else ""
    signature = inspect.signature(thing)
    named = [p for p in signature.parameters if not p.startswith("_") and p not in ("self", "cls")]
    if not ELSEWHERE.search(text):
        missing = [p for p in named if not re.search(rf"\b{re.escape(p)}\b", text)]
        assert not missing, f"does not explain {', '.join(missing)}"
    kinds = [str(p.annotation) for p in signature.parameters.values()] + [
        str(signature.return_annotation)
    ]
    if any(kind in text for text in kinds for kind in ARRAYS) and not ELSEWHERE.search(text):
        assert re.search(r"\([\w.:]+(, *[\w. +*/]+)*,?\)|scalar", text), "has arrays and no shape"
        assert re.search(r"\[[^\]]+\]|unit|index|indices|colour|world|True", text), (
            "has arrays and no unit"
        )
