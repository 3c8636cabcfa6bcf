"""Compile an MJCF file whose bodies may carry the plugin; what would crash MuJoCo's compiler is refused before."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import mujoco

from mjskip._typing import PathLike
from mjskip.coupling.plugin import register_plugin
from mjskip.coupling.plugin_keys import NAME
from mjskip.errors import SceneError
from mjskip.hydro.seas import Sea


def load_model(path: PathLike, *, sea: str | None = None) -> mujoco.MjModel:
    """The compiled model of an MJCF file; the plugin is registered if it turns out to be needed.

    Args:
        path: the file.
        sea: waves and current instead of those of every instance of the plugin whose bodies radiate, see
            `Sea.from_text`.

    Raises:
        SceneError: the file is not there, does not compile, or replicates bodies whose plugin MuJoCo cannot
            replicate.
    """
    file = Path(path)
    if not file.is_file():
        raise SceneError(f"no file {str(file)!r}: give an MJCF file")
    check_replicated_plugins(file)
    if sea is not None:
        return _with_sea(file, sea)
    try:
        try:
            return mujoco.MjModel.from_xml_path(str(file))
        except ValueError as error:
            if f"plugin {NAME} not found" not in str(error):
                raise
        register_plugin()
        return mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"{file} does not compile as MJCF: {reason}") from error


def _with_sea(file: Path, sea: str) -> mujoco.MjModel:
    """The compiled model with another sea."""
    Sea.from_text(sea)
    register_plugin()
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        found_plugins = [
            one
            for one in spec.plugins
            if one.plugin_name == NAME and one.config.get("radiation") == "true"
        ]
        if not found_plugins:
            raise SceneError(
                f'no instance of plugin {NAME} in {file} has radiation="true": a sea acts on bodies that radiate'
            )
        for one in found_plugins:
            one.config = {**one.config, "sea": sea}
        return spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"{file} does not compile as MJCF: {reason}") from error


def check_replicated_plugins(file: Path) -> None:
    """Refuse what ends MuJoCo's compiler and this process with it: copies of what names a plugin's instance.

    It is looked for in the file and in those that it includes.

    Raises:
        SceneError: it is there; says what to write instead.
    """
    replicated, copied, sensors = False, "", ""
    for element, above in _elements(file, file.parent, frozenset()):
        counts = [e for e in above if e.tag == "replicate" and e.get("count", "1").strip() != "1"]
        replicated |= element.tag == "replicate"
        if element.tag == "plugin" and element.get("instance"):
            if counts:
                copied = copied or str(element.get("instance"))
            if any(e.tag == "sensor" for e in above):
                sensors = sensors or str(element.get("instance"))
    if copied:
        raise SceneError(
            f'{file}: <plugin instance="{copied}"/> within <replicate> ends MuJoCo\'s compiler: write '
            f'<plugin plugin="{NAME}"> <config .../> </plugin> there instead, with the keys of that instance'
        )
    if sensors and replicated:
        raise SceneError(
            f'{file}: a <sensor> with <plugin instance="{sensors}"/> beside <replicate> ends MuJoCo\'s compiler: '
            "write the copies out instead of <replicate>, or leave the sensor out"
        )


def _elements(
    file: Path, home: Path, seen: frozenset[Path]
) -> Iterator[tuple[ElementTree.Element, tuple[ElementTree.Element, ...]]]:
    """Elements of a file and of those that it includes, each with those around it."""
    if file in seen:
        return
    try:
        root = ElementTree.fromstring(file.read_bytes())
    except (OSError, ElementTree.ParseError, LookupError, ValueError):
        return  # MuJoCo says what is wrong with it
    seen |= {file}
    waiting: list[tuple[ElementTree.Element, tuple[ElementTree.Element, ...]]] = [(root, ())]
    while waiting:
        element, above = waiting.pop()
        if element.tag == "include" and element.get("file"):
            name = str(element.get("file"))
            inner = next((p for p in (home / name, file.parent / name) if p.is_file()), None)
            if inner is not None:
                for found, within in _elements(inner.resolve(), home, seen):
                    yield found, (*above, *within)
        yield element, above
        waiting += [(child, (*above, element)) for child in element]
