"""The documentation is true: every Python block runs, every public name is explained, the site is whole."""

import ast
import inspect
import os
import re
from pathlib import Path

import pytest

import mjskip

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"(<!-- not run: [^\n]* -->\n)?```python\n(.*?)```", re.DOTALL)


def blocks(page):
    """Python blocks of a page that are meant to run, with the line at which each begins."""
    text = page.read_text()
    return [
        (text.count("\n", 0, found.start(2)) + 1, found[2])
        for found in BLOCK.finditer(text)
        if not found[1]
    ]


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p)], ids=lambda page: page.name)
def test_every_python_block_runs_in_the_order_of_its_page(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUJOCO_GL", os.environ.get("MUJOCO_GL", "egl"))
    names = {"__name__": "page"}
    for line, code in blocks(page):
        tree = ast.parse(code, str(page))
        ast.increment_lineno(tree, line - 1)
        exec(compile(tree, str(page), "exec"), names)


def public_callables():
    """Every public function, class and public method, with its name."""
    for name in mjskip.__all__:
        thing = getattr(mjskip, name)
        if inspect.isfunction(thing):
            yield name, thing
        elif inspect.isclass(thing):
            yield name, thing
            for attribute, member in vars(thing).items():
                inner = getattr(member, "__func__", getattr(member, "fget", member))
                if not attribute.startswith("_") and inspect.isfunction(inner):
                    yield f"{name}.{attribute}", inner


PUBLIC = list(public_callables())


@pytest.mark.parametrize(("name", "thing"), PUBLIC, ids=[name for name, _ in PUBLIC])
def test_every_public_name_says_what_it_does_and_every_argument_is_explained(name, thing):
    text = inspect.getdoc(thing)
    assert text, f"{name} has no docstring"
    if inspect.isclass(thing):
        text += inspect.getdoc(thing.__init__) or ""
    missing = [
        parameter
        for parameter in inspect.signature(thing).parameters
        if parameter not in ("self", "cls") and not re.search(rf"\b{re.escape(parameter)}\b", text)
    ]
    assert not missing, f"{name} does not explain {missing}"


ARRAY = re.compile(r"\b(Array\w*|NDArray|ArrayLike|ndarray)\b")


@pytest.mark.parametrize(("name", "thing"), PUBLIC, ids=[name for name, _ in PUBLIC])
def test_arrays_are_documented_with_their_shapes_and_units(name, thing):
    annotations = " ".join(str(value) for value in getattr(thing, "__annotations__", {}).values())
    if not ARRAY.search(annotations):
        pytest.skip("no arrays")
    text = inspect.getdoc(thing) + (inspect.getdoc(getattr(thing, "__init__", None)) or "")
    assert re.search(r"\(\w*,[^)]*\)|scalar|broadcast", text), f"{name} names no shape"
    assert re.search(r"\[[^\]]+\]|dimensionless|index|quaternion|w-x-y-z|[Tt]rue", text), (
        f"{name} names no unit"
    )


def test_the_reference_page_shows_every_public_name():
    shown = set(re.findall(r"^::: mjskip\.(\w+)", (ROOT / "docs/reference.md").read_text(), re.M))
    assert shown == set(mjskip.__all__)


def test_every_page_is_in_the_navigation():
    listed = set(re.findall(r"[\w-]+\.md", (ROOT / "mkdocs.yml").read_text()))
    assert listed == {page.name for page in (ROOT / "docs").glob("*.md")}
