"""The documentation is true: every Python block runs, every public name is in the reference, the site is whole."""

import ast
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


def test_the_reference_page_shows_every_public_name():
    shown = set(re.findall(r"^::: mjskip\.(\w+)", (ROOT / "docs/reference.md").read_text(), re.M))
    assert shown == set(mjskip.__all__)


def test_every_page_is_in_the_navigation():
    listed = set(re.findall(r"[\w-]+\.md", (ROOT / "mkdocs.yml").read_text()))
    assert listed == {page.name for page in (ROOT / "docs").glob("*.md")}


def test_contributing_names_tests_that_there_are():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    named = set(re.findall(r"`(test_\w+)`", text))
    assert len(named) > 20
    assert not [name for name in named if not (ROOT / "tests" / f"{name}.py").exists()]
