"""The layout of the Python package: what may import what. CONTRIBUTING.md says what the packages are."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from fortran_arguments import arguments

SOURCE = Path(__file__).resolve().parents[2] / "python"
FORTRAN = SOURCE.parent / "src"
# Its evidence, a package of its own beside it
VERIFICATION = "attrito_verification"
# From below: a package imports only packages of floors below its own, and its own modules.
FLOORS = (
    ("support",),
    ("library", "model"),
    ("job",),
    ("importers",),
    ("scene",),
    ("results",),
    ("runs", "integration", "plots", "export"),
    ("peaks", "report", "stresses"),
    ("modes",),
    ("studies", "charts"),
    ("fits",),
    ("optima",),
    ("api", "pictures", VERIFICATION),
    ("differentiable",),
    ("cli",),
)
FLOOR_OF = {package: floor for floor, packages in enumerate(FLOORS) for package in packages}


def modules(source: Path = SOURCE) -> dict[str, Path]:
    """Every module of the package by its dotted name; a package by that of its folder."""
    found = {}
    for path in sorted(path for name in ("attrito", VERIFICATION) for path in source.rglob(f"{name}/**/*.py")):
        found[".".join(path.relative_to(source).with_suffix("").parts).removesuffix(".__init__")] = path
    return found


def imports(paths: dict[str, Path]) -> dict[str, set[str]]:
    """Modules that each imports: at its head, within a function, or for its types alone (`TYPE_CHECKING`)."""
    found: dict[str, set[str]] = {}
    for module, path in paths.items():
        named: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{module} imports relative to itself"
                for alias in node.names:
                    whole = f"{node.module}.{alias.name}"
                    named.add(whole if whole in paths else node.module)
        found[module] = {name for name in named if name.partition(".")[0] in ("attrito", VERIFICATION)} - {module}
    return found


def package_of(module: str) -> str:
    """`job` of `attrito.job.checks`; a package beside `attrito` by its own name."""
    top, *parts = module.split(".")
    return parts[0] if top == "attrito" else top


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Modules that import one another in a circle; empty where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_what_the_package_imports_is_what_it_depends_on():
    """Of other projects: the dependencies of pyproject.toml, each named as its module is; also the optional ones."""
    imported = {
        name.partition(".")[0]
        for path in modules().values()
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module])
    }
    project = tomllib.loads((SOURCE / "pyproject.toml").read_text())["project"]
    optional = [one for extra in project["optional-dependencies"].values() for one in extra]
    needed = {re.match(r"[\w-]+", requirement)[0] for requirement in [*project["dependencies"], *optional]}
    assert imported - sys.stdlib_module_names - {"attrito", VERIFICATION} == needed


def test_every_module_has_a_package_with_a_floor():
    found = {package_of(module) for module in modules() if module != "attrito"}
    assert found == set(FLOOR_OF)


def test_a_package_imports_only_packages_below_it():
    graph = imports(modules())
    assert sum(map(len, graph.values())) > 500
    upwards = [
        f"{module} imports {name}"
        for module, names in graph.items()
        if module != "attrito"
        for name in sorted(names)
        if name == "attrito"
        or (package_of(name) != package_of(module) and FLOOR_OF[package_of(name)] >= FLOOR_OF[package_of(module)])
    ]
    assert upwards == []


def test_no_modules_import_one_another_in_a_circle_not_even_for_types():
    assert circle(imports(modules())) == []


def test_no_file_of_tests_imports_another():
    """What several need is in a file of its own, so that each file of tests can be read, and run, alone."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    found = [path.name for path in files if re.search(r"^\s*(from|import) test_", path.read_text(), flags=re.MULTILINE)]
    assert len(files) > 60 and found == []


@pytest.mark.parametrize("head", ["", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    "])
def test_a_circle_would_be_found(tmp_path, head):
    (tmp_path / "attrito" / "job").mkdir(parents=True)
    for name, other in (("one", "two"), ("two", "one")):
        (tmp_path / "attrito" / "job" / f"{name}.py").write_text(f"{head}from attrito.job.{other} import Thing\n")
    assert set(circle(imports(modules(tmp_path)))) == {"attrito.job.one", "attrito.job.two"}


def test_dummy_arguments_of_fortran_have_a_line_each():
    files = sorted((SOURCE.parent / "src").rglob("*.[fF]90"))
    bare = {}
    count = 0
    for path in files:
        found = arguments(path)
        count += len(found)
        if missing := [f"{one.procedure}({one.name})" for one in found if not one.described]:
            bare[path.name] = missing
    assert count > 3500
    assert sum(map(len, bare.values())) < 0.05 * count, bare


def test_an_argument_without_a_line_is_found(tmp_path):
    (tmp_path / "some.f90").write_text(
        "subroutine some(self, a, b, &\n                c)\n  class(x_type), intent(in) :: self\n  !> One\n"
        "  real(wp), intent(in) :: a(2, 2), b\n  integer, intent(out) :: c\n  integer :: local\nend subroutine some\n"
    )
    assert [(one.name, one.described) for one in arguments(tmp_path / "some.f90")] == [
        ("a", True),
        ("b", True),
        ("c", False),
    ]


@pytest.mark.parametrize("length", [72, 73])
def test_a_commit_s_subject_has_at_most_72_characters(tmp_path, length):
    (tmp_path / "message").write_text(f"# A comment\n\n{'é' * length}\n\n{'b' * 100}\n")
    hook = SOURCE.parent / "script" / "hooks" / "commit-msg"
    done = subprocess.run([hook, tmp_path / "message"], capture_output=True, text=True)
    assert (done.returncode, "73 characters" in done.stderr) == ((0, False) if length == 72 else (1, True))


# A real constant of Fortran, and the word at its end that says where its number is from
CONSTANT = re.compile(r"\s*real\(\w+\), parameter :: (\w+)[^!&]*?&?\s*(?:! (\w+))?$")
KINDS = {"guess", "measured", "derived", "conventional"}


def test_every_real_constant_of_fortran_has_a_comment_and_says_where_its_number_is_from():
    found, wrong = 0, []
    for path in sorted(FORTRAN.rglob("*.[fF]90")):
        is_commented = False
        for line in path.read_text().split("\n"):
            declared = CONSTANT.match(line)
            if declared:
                found += 1
                wrong += [f"{path}: {declared[1]}"] if declared[2] not in KINDS or not is_commented else []
            is_commented = "!>" in line or (is_commented and ", parameter ::" in line)
    assert found > 200
    assert not wrong
