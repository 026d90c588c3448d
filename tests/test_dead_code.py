"""Everything in canid/ is used by canid: a graph of references, followed from what runs by itself.

A definition (function, class, method, constant) is used if the statements that run on import, an entry point, the public
interface of `canid/__init__.py` or another used definition refers to it. Names are resolved through imports; a method is
used where a used definition, or a template, has an attribute or a text of its name.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
TEMPLATES = ("*.j2", "*.html")
PACKAGES = ("canid", "canid_study")
# methods that the user calls on a result, and that notebooks, python-can's Notifier and pydantic call
HOOKS = {"to_frame", "summary", "plot", "_repr_html_"}
# bases that call no method of a class by its name
PLAIN_BASES = {"NamedTuple", "Protocol", "Enum", "Exception", "Generic", "TypedDict", "RuntimeError"}
PLAIN_DECORATORS = {"property", "cached_property", "staticmethod", "classmethod", "cache"}

# what stands there all the same, and why
ALLOWED = {
    "canid.io.logs.log:Log.events_read": "with the other counts of Log it accounts for every line of a file",
    "canid.analysis.export.fmu_driver:CanidDriver": "pythonfmu3 makes it within an FMU",
    "canid.analysis.export.fmu_driver:CanidDriver.do_step": "the simulator that runs the FMU calls it",
}
# distributions that no module imports, and why they are needed
UNIMPORTED = {
    "aiohttp": "fsspec's http://",
    "h11": "uvicorn's HTTP, of a version without a known hole",
    "s3fs": "fsspec opens s3:// with it",
    "slycot": "python-control calls it",
}

Function = ast.FunctionDef | ast.AsyncFunctionDef
Name = tuple[str, str]  # module, and "f", "Class.f" or "" for the module's statements


class Definition(NamedTuple):
    """What a definition refers to."""

    references: list[tuple[str, list[str]]]  # a name, and the attributes that follow it
    local: set[str]  # names that a function binds itself
    texts: set[str]
    bases: set[str]  # of a class
    decorators: list[str]  # of a function


class Module(NamedTuple):
    """What a module defines, and what its imports bind."""

    definitions: dict[str, Definition]  # "f", "Class.f", "" for the statements that run on import
    imports: dict[str, str]  # name -> dotted name of what it stands for


def statements(body: list[ast.stmt]) -> Iterator[ast.AST]:
    """Statements of a module or a class, with those under `if`, `try` and `with`."""
    for statement in body:
        if isinstance(statement, ast.If | ast.Try | ast.With):
            for field in ("body", "orelse", "finalbody"):
                yield from statements(getattr(statement, field, []))
            for handler in getattr(statement, "handlers", []):
                yield from statements(handler.body)
            if isinstance(statement, ast.If):
                yield statement.test
        else:
            yield statement


def assigned(statement: ast.AST) -> list[str]:
    """Names that an assignment makes."""
    targets: list[ast.expr] = []
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign):
        targets = [statement.target]
    return [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]


def bound(node: ast.Import | ast.ImportFrom) -> dict[str, str]:
    """Names that an import binds."""
    if isinstance(node, ast.ImportFrom):
        return {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    return {
        a.asname or a.name.split(".")[0]: a.name if a.asname else a.name.split(".")[0] for a in node.names
    }


def put(module: Module, name: str, tops: Iterable[ast.AST], of_class: ast.ClassDef | None = None) -> None:
    """Note what some nodes refer to, as a definition's."""
    bases = {ast.unparse(base) for base in of_class.bases} if of_class else set()
    made = module.definitions.setdefault(name, Definition([], set(), set(), bases, []))
    for top in tops:
        if isinstance(top, Function):
            made.decorators.extend(map(ast.unparse, top.decorator_list))
        todo: list[ast.AST] = [top]
        while todo:
            node = todo.pop()
            chain: list[str] = []
            while isinstance(node, ast.Attribute):
                chain.insert(0, node.attr)
                node = node.value
            if isinstance(node, ast.Name):
                made.references.append((node.id, chain))
                if isinstance(top, Function) and not isinstance(node.ctx, ast.Load):
                    made.local.add(node.id)
                continue
            if chain:
                made.references.append(("", chain))
            if isinstance(node, ast.Constant):
                if isinstance(node.value, str):
                    made.texts.add(node.value)
            elif isinstance(node, ast.arg):
                made.local.add(node.arg)
            elif isinstance(node, ast.Import | ast.ImportFrom):
                module.imports.update(bound(node))
            todo += ast.iter_child_nodes(node)


def read(path: Path) -> Module:
    """Parse a module."""
    module = Module({}, {})
    for statement in statements(ast.parse(path.read_text(encoding="utf-8")).body):
        if isinstance(statement, ast.ClassDef):
            items = list(statements(statement.body))
            held = [*statement.bases, *statement.keywords, *statement.decorator_list]
            put(module, statement.name, held + [x for x in items if not isinstance(x, Function)], statement)
            for item in items:
                if isinstance(item, Function):
                    put(module, f"{statement.name}.{item.name}", [item])
        elif isinstance(statement, Function):
            put(module, statement.name, [statement])
        elif names := assigned(statement):
            for name in names:
                put(module, name, [statement])
        else:
            put(module, "", [statement])
    return module


@cache
def modules() -> dict[str, Module]:
    """All modules of both packages, by dotted name."""
    found = {}
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = read(path)
    return found


@cache
def resolved(dotted: str, depth: int = 0) -> Name | None:
    """What a dotted name stands for, through what modules import from each other."""
    known, parts = modules(), dotted.split(".")
    for k in range(len(parts), 0, -1):
        name, rest = ".".join(parts[:k]), parts[k:]
        if name not in known:
            continue
        for n in range(min(2, len(rest)), 0, -1):
            if ".".join(rest[:n]) in known[name].definitions:
                return name, ".".join(rest[:n])
        if rest and rest[0] in known[name].imports and depth < 9:
            return resolved(".".join([known[name].imports[rest[0]], *rest[1:]]), depth + 1)
        return None
    return None


def used(module_name: str, definition: Definition) -> tuple[set[Name], set[str]]:
    """What a definition refers to: names that resolve, and names of attributes, which may be methods."""
    imports = modules()[module_name].imports
    names: set[Name] = set()
    attributes = set(definition.texts)
    values = (
        set()
    )  # modules that stand for a value: `task = lane_keeping`, whose functions are then attributes of `task`
    for root, chain in definition.references:
        attributes.update(chain)
        if root in imports or root not in definition.local:
            if not chain and imports.get(root) in modules():
                values.add(imports[root])
            for base in {imports.get(root), f"{module_name}.{root}"} - {None}:
                if target := resolved(".".join([str(base), *chain])):
                    names.add(target)
    names |= {
        (value, name) for value in values for name in modules()[value].definitions if name in attributes
    }
    # a registry: a module by its name, and what is in it
    for text in definition.texts & modules().keys():
        there = modules()[text].definitions
        names |= {
            (text, name) for name in there if name and name.removesuffix("_columns") in definition.texts
        }
    return names, attributes


def is_entry(module: str, name: str) -> bool:
    """Whether something outside the package, or a name put together as the program runs, calls it."""
    if module == "canid" or name in ("", "__all__", "__getattr__", "__dir__"):
        return True
    if module == "canid.io.logs.text_writers":  # by suffix
        return name in ("AscWriter", "CandumpWriter")
    if module == "canid.io.logs.others.frame_list":  # by the form of a line
        named = modules()["canid.io.logs.formats"].definitions
        return name in named["FORMS"].texts | named["UNKNOWN_LIST"].texts
    return (module, name) == ("canid.ui.cli", "main") or (
        module.startswith("canid.ui.cli") and name in ("arguments", "run", "results")
    )


def is_called_back(module: str, definition: Definition) -> bool:
    """Whether a class has a base from elsewhere, which calls its methods."""
    imports = modules()[module].imports
    foreign = {base for base in definition.bases if not resolved(imports.get(base, f"{module}.{base}"))}
    return bool(foreign - PLAIN_BASES)


def is_registered(definition: Definition) -> bool:
    """Whether a method has a decorator that has it called: pydantic's validators, for one."""
    return any(not PLAIN_DECORATORS & set(re.findall(r"\w+", text)) for text in definition.decorators)


@cache
def unused() -> frozenset[str]:
    """Definitions of canid that nothing used refers to, as "module:name"; of canid_study benchmarks use more."""
    every = {(m, name): of for m, module in modules().items() for name, of in module.definitions.items()}
    methods: dict[str, list[Name]] = {}
    members: dict[Name, list[Name]] = {}
    for module, name in every:
        owner, dot, method = name.partition(".")
        if dot:
            methods.setdefault(method, []).append((module, name))
            members.setdefault((module, owner), []).append((module, name))
    templates = [path for pattern in TEMPLATES for path in (ROOT / "canid").rglob(pattern)]
    attributes: set[str] = set().union(*(re.findall(r"\w+", path.read_text("utf-8")) for path in templates))
    todo = [key for key in every if is_entry(*key)]
    todo += [target for dotted in modules()["canid"].imports.values() if (target := resolved(dotted))]
    todo += [method for name in attributes for method in methods.get(name, ())]
    reached: set[Name] = set()
    while todo:
        key = todo.pop()
        if key in reached:
            continue
        reached.add(key)
        names, more = used(key[0], every[key])
        todo += names
        todo += [method for name in more - attributes for method in methods.get(name, ())]
        attributes |= more
        called_back = is_called_back(key[0], every[key])
        for member in members.get(key, ()):
            method = member[1].partition(".")[2]
            if called_back or method in HOOKS or method.startswith("__") or is_registered(every[member]):
                todo.append(member)
    return frozenset(f"{m}:{name}" for m, name in every.keys() - reached if m.startswith("canid."))


def test_everything_is_used() -> None:
    """What is found here goes; a test that needs it as a reference keeps it in tests/."""
    assert unused() - ALLOWED.keys() == set()


def test_nothing_is_allowed_that_is_used() -> None:
    assert ALLOWED.keys() - unused() == set()


def test_every_dependency_is_imported() -> None:
    """Those of the package and of its extras for users."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    stated = [
        *project["dependencies"],
        *(x for name in extras.keys() - {"bench", "fuzz", "dev"} for x in extras[name]),
    ]
    distributions = {plain(re.split(r"[\[<>=!~ ]", text)[0]) for text in stated}
    names = {dotted for module in modules().values() for dotted in module.imports.values()}
    for module in modules().values():
        names.update(*(definition.texts for definition in module.definitions.values()))
    providers = packages_distributions()
    imported = {plain(d) for name in names for d in providers.get(name.split(".")[0], ())}
    assert distributions - imported == UNIMPORTED.keys()


def plain(distribution: str) -> str:
    """A distribution's name as registries compare it."""
    return distribution.lower().replace("_", "-")
