"""The page's JavaScript modules as one script: each keeps its names and its text, without indentation and the lines
that are comments, and gives the others what it exports.

A file cannot hold modules that import each other by name, and a build step would need tools that a clone lacks. So the
modules keep to the few forms that are read here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

IMPORT = re.compile(r'^import \{\s([^}]*?),?\s\} from "\./(\w+)\.mjs";\n', re.MULTILINE)
EXPORT = re.compile(r"^export ((?:async )?function|const|class) (\w+)", re.MULTILINE)
COMMENT = re.compile(r"^[ \t]*(?://[^\n]*|/\*\*(?:(?!\*/).)*\*/)\n", re.MULTILINE | re.DOTALL)  # of whole lines
INDENTATION = re.compile(r"^[ \t]+", re.MULTILINE)
ANY = re.compile(r"^(?:import|export)\b.*", re.MULTILINE)


def linked(modules: Mapping[str, str], entry: str) -> str:
    """The script that runs the module `entry`; modules: their texts by name. Each follows those that it imports.

    Raises ValueError on an import or export of another form, of what is not there, or round in a circle.
    """
    done: dict[str, str] = {}
    _link(modules, entry, done, ())
    return "\n".join(done.values())


def _link(modules: Mapping[str, str], name: str, done: dict[str, str], path: tuple[str, ...]) -> None:
    if name in done:
        return
    if name in path:
        raise ValueError(f"modules import each other in a circle: {' -> '.join([*path, name])}")
    text, taken = COMMENT.sub("", modules[name]), []
    for names, source in IMPORT.findall(text):
        _link(modules, source, done, (*path, name))
        wanted = [each.strip() for each in names.split(",")]
        missing = set(wanted) - {found for _, found in EXPORT.findall(modules[source])}
        if missing:
            raise ValueError(f"{name}.mjs imports {', '.join(sorted(missing))}, which {source}.mjs does not export")
        taken.append(f"const {{ {', '.join(wanted)} }} = {source}Module;")
    given = ", ".join(found for _, found in EXPORT.findall(text))
    body = EXPORT.sub(r"\1 \2", IMPORT.sub("", text))
    if other := ANY.search(body):
        raise ValueError(f"{name}.mjs has a form of import or export that is not linked: {other[0]}")
    body = INDENTATION.sub("", body).strip()
    done[name] = "\n".join([f"const {name}Module = (() => {{", *taken, body, f"return {{ {given} }};", "})();"])
