"""`python -m benchmarks house [COMMIT]`: how large the house is, at this checkout or at a commit.

Lines, numbers, untyped dicts, names of classes that stand for two things, and questions of kind. Trends count, not
single figures.
"""

import argparse
import ast
import io
import subprocess
import tarfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping

from benchmarks.common.places import REPOSITORY

PRODUCT = ("app", "services", "models")
FOLDERS = (*PRODUCT, "simulation", "benchmarks", "tests")
UNTYPED = frozenset({"dict[str, Any]", "dict[str, object]", "Mapping[str, Any]", "Mapping[str, object]"})
SHAPES = frozenset(
    {"PlanarPage", "CurvedPage", "RidgedPage", "PlaneSurface", "StripsSurface", "MeshSurface", "PlacedPlane"}
)


def sources(commit: str | None) -> Mapping[str, str]:
    """The text of every Python file by its path."""
    if commit is None:
        paths = [path for folder in FOLDERS for path in sorted((REPOSITORY / folder).rglob("*.py"))]
        return {str(path.relative_to(REPOSITORY)): path.read_text("utf-8") for path in paths}
    packed = subprocess.run(
        ["git", "archive", commit, *FOLDERS], cwd=REPOSITORY, capture_output=True, check=True
    ).stdout
    found = {}
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        for member in archive:
            file = archive.extractfile(member) if member.name.endswith(".py") else None
            if file is not None:
                found[member.name] = file.read().decode("utf-8")
    return found


def figures(files: Mapping[str, str]) -> dict[str, int]:
    """The figures, by what they count."""
    lines: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    classes: defaultdict[str, set[str]] = defaultdict(set)
    for path, text in files.items():
        folder = path.partition("/")[0]
        lines[f"lines of {folder}"] += text.count("\n")
        if folder not in PRODUCT:
            continue
        counts["modules directly in app"] += path.startswith("app/") and path.count("/") == 1
        for node in ast.walk(ast.parse(text)):
            counts.update(_counted(node))
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].add(path)
    counts["names of two classes"] = sum(len(places) > 1 for places in classes.values())
    whole = sum(lines[f"lines of {folder}"] for folder in PRODUCT)
    return {"lines of the product": whole, **lines, **counts}


def _counted(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Subscript() if ast.unparse(node) in UNTYPED:
            yield "untyped dicts" if ast.unparse(node).startswith("dict") else "untyped mappings"
        case ast.ClassDef(name=name, body=body) if name.endswith("Parameters"):
            yield "parameter classes"
            yield from ("fields of these" for each in body if isinstance(each, ast.AnnAssign))
        case ast.Module(body=body):
            yield from ("numeric constants" for each in body if _is_number(each))
        case ast.Call(func=ast.Name(id="isinstance"), args=[_, kinds]) if _names(kinds) & SHAPES:
            yield "questions of kind on shapes"
        case ast.match_case(pattern=pattern) if _names(pattern) & SHAPES:
            yield "questions of kind on shapes"


def _is_number(node: ast.stmt) -> bool:
    value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
    numbers = [each for each in ast.walk(value) if isinstance(each, ast.Constant)] if value else []
    return bool(numbers) and all(isinstance(each.value, int | float) for each in numbers)


def _names(node: ast.AST) -> set[str]:
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}


def main(arguments: list[str] | None = None) -> int:
    """Print the figures of this checkout, and of a commit beside them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks house", description=__doc__)
    parser.add_argument("commit", nargs="?", help="compared with this checkout")
    options = parser.parse_args(arguments)
    now = figures(sources(None))
    then = figures(sources(options.commit)) if options.commit else {}
    for name, count in now.items():
        print(f"{name:32s} {count:7d}" + (f"  {then.get(name, 0):7d} at {options.commit}" if then else ""))
    return 0
