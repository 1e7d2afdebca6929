"""Parts of kernels are compiled into kernels: Python that called one would compile it in flight."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("agents", "control", "formation", "simulator", "studies", "vehicles", "vicon_gateway")


def module_of(path: Path) -> str:
    """The name by which a file is imported."""
    name = path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    return name.removeprefix("studies.") if name.startswith("studies.") else f"rcopterx.{name}"


TREES = {
    module_of(path): ast.parse(path.read_text("utf-8"))
    for folder in FOLDERS
    for path in (ROOT / folder).rglob("*.py")
}


def decorators(function: ast.FunctionDef) -> set[str]:
    """Names of the decorators of a function."""
    called = (each.func if isinstance(each, ast.Call) else each for each in function.decorator_list)
    return {each.id for each in called if isinstance(each, ast.Name)}


PARTS = {
    (module, node.name)
    for module, tree in TREES.items()
    for node in ast.walk(tree)
    if isinstance(node, ast.FunctionDef) and "part" in decorators(node)
}


def parts_in(module: str, tree: ast.AST) -> set[str]:
    """Names of parts that a module defines or imports."""
    imported = {
        name.asname or name.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for name in node.names
        if (node.module, name.name) in PARTS
    }
    return imported | {name for place, name in PARTS if place == module}


def calls_of_python(tree: ast.AST) -> Iterator[ast.Call]:
    """Calls outside of kernels and of parts of kernels."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef) and decorators(node) & {"part", "compiled"}:
            continue
        if isinstance(node, ast.Call):
            yield node
        yield from calls_of_python(node)


def test_python_calls_no_part_of_a_kernel() -> None:
    assert len(PARTS) > 20
    found = [
        f"{module}, line {call.lineno}: {call.func.id}"
        for module, tree in TREES.items()
        for call in calls_of_python(tree)
        if isinstance(call.func, ast.Name) and call.func.id in parts_in(module, tree)
    ]
    assert found == []
