"""The border to Fortran: the C header, Python's signatures, names and structures agree with the library."""

from __future__ import annotations

import ctypes
import re
import subprocess
from pathlib import Path

import bench_library
import prototypes
import pytest

from attrito.library import loading
from attrito.library.description import describe
from attrito.library.names import ENUMERATIONS
from attrito.library.signatures import EXHAUSTED, LISTENER, SERIES_CALLBACK, SIGNATURES
from attrito.library.structures import STRUCTURES, Doubles, Integers, Longs
from attrito.support.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
MODULES = Path(loading.load()._name).resolve().parent / "modules"
HEADER = (ROOT / "src" / "api" / "attrito.h").read_text()
PLAIN = {"void": None, "int": ctypes.c_int, "double": ctypes.c_double, "char": ctypes.c_char}
POINTERS = {
    "void *": ctypes.c_void_p,
    "void **": ctypes.POINTER(ctypes.c_void_p),
    "char *": ctypes.c_char_p,
    "double *": Doubles,
    "int *": Integers,
    "long *": Longs,
    "attrito_series_callback": SERIES_CALLBACK,
    "attrito_listener": LISTENER,
    "attrito_exhausted_callback": EXHAUSTED,
}
POINTERS |= {f"attrito_{name} *": ctypes.POINTER(kind) for name, kind in STRUCTURES.items()}


def bare(header: str) -> str:
    """Declarations of C in one line, without comments."""
    return " ".join(re.sub(r"/\*.*?\*/|^#.*?$", "", header, flags=re.S | re.M).split())


def types_of(words: str) -> tuple[object, str]:
    """Type and name of one declaration of C: `const double *mass`."""
    kind, name = re.fullmatch(r"(?:const )?(\w+ ?\**) ?(\w+)", words.strip()).groups()
    kind = kind.strip()
    return (PLAIN | POINTERS)[kind], name


def entries(header: str = HEADER) -> dict[str, tuple[object, list[object]]]:
    """What each entry of a header returns and takes."""
    found = {}
    for returned, name, arguments in re.findall(r"(\w+ \*?)(attrito_\w+)\(([^()]*)\);", bare(header)):
        taken = [] if arguments == "void" else [types_of(one)[0] for one in arguments.split(",")]
        found[name] = (types_of(f"{returned}{name}")[0], taken)
    return found


def fields_in_c() -> dict[str, list[tuple[str, str]]]:
    """Type and name of each field of the header's structures."""
    return {
        name: re.findall(r"(\w+ ?\*?) ?(\w+)(?:\[\d+\])?;", body)
        for body, name in re.findall(r"typedef struct \{(.*?)\} attrito_(\w+);", bare(HEADER))
    }


def test_the_header_is_what_the_fortran_sources_say():
    assert prototypes.header(MODULES) == HEADER, "script/header makes it"


def test_every_procedure_with_a_name_in_c_is_in_the_header():
    procedures = set()
    for source in (ROOT / "src").rglob("*.[fF]90"):
        text = re.sub(r"&\s*\n\s*", "", source.read_text())
        procedures |= set(re.findall(r"^[^!\n]*\b(?:subroutine|function) (attrito_\w+)\(.*bind\(c\)", text, flags=re.M))
    assert len(procedures) > 60 and procedures == set(entries())


def test_python_s_signatures_are_those_of_the_header():
    ours = {name: (returned, list(taken)) for name, (returned, taken) in SIGNATURES.items()}
    assert ours == entries()


def test_signatures_of_the_benchmarks_library_are_those_of_its_source():
    declared = entries(prototypes.declarations(ROOT / "benchmarks" / "kernels.f90", MODULES))
    assert len(declared) > 5
    assert declared == {name: (returned, list(taken)) for name, (returned, taken) in bench_library.SIGNATURES.items()}


def test_the_package_s_library_has_no_entries_of_the_benchmarks_alone():
    library, beside = loading.load(), bench_library.load()
    assert beside._name != library._name
    assert [name for name in bench_library.SIGNATURES if hasattr(library, name)] == []


def test_a_loaded_library_has_the_signatures():
    library = loading.load()
    for name, (returned, taken) in SIGNATURES.items():
        assert getattr(library, name).restype is returned and getattr(library, name).argtypes == list(taken)


def test_names_that_cross_as_numbers_are_the_same_on_both_sides():
    ours = {
        name: values if isinstance(values, dict) else {one: number for number, one in enumerate(values)}
        for name, values in ENUMERATIONS.items()
    }
    assert ours == describe(loading.load()).names


def test_structures_are_as_large_on_both_sides():
    ours = {name: ctypes.sizeof(kind) for name, kind in STRUCTURES.items()}
    assert ours == describe(loading.load()).sizes


def test_c_has_the_structures_as_python_has_them(tmp_path):
    """Field by field: the compiler says where each lies. The names may differ, the places and types not."""
    fields = fields_in_c()
    assert set(fields) == set(STRUCTURES)
    lines = [
        f'printf("{name} %zu %zu\\n", offsetof(attrito_{name}, {field}), sizeof(((attrito_{name} *)0)->{field}));'
        for name, declared in fields.items()
        for _, field in declared
    ]
    program = tmp_path / "layout.c"
    program.write_text(
        '#include <stddef.h>\n#include <stdio.h>\n#include "attrito.h"\nint main(void) {\n'
        + "\n".join(lines)
        + "\nreturn 0;\n}\n"
    )
    words = ["gcc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{ROOT / 'src' / 'api'}"]
    subprocess.run([*words, str(program), "-o", str(tmp_path / "layout")], check=True)
    measured = subprocess.run([tmp_path / "layout"], capture_output=True, text=True, check=True).stdout.splitlines()
    ours = [
        f"{name} {getattr(STRUCTURES[name], field).offset} {getattr(STRUCTURES[name], field).size}"
        for name in fields
        for field, _ in STRUCTURES[name]._fields_
    ]
    assert measured == ours and len(measured) > 100


def test_c_s_types_of_fields_are_python_s():
    for name, declared in fields_in_c().items():
        for (kind, field), (ours, python) in zip(declared, STRUCTURES[name]._fields_, strict=True):
            of_one = getattr(python, "_type_", None) if issubclass(python, ctypes.Array) else python
            structures = {f"attrito_{key}": value for key, value in STRUCTURES.items()}
            assert (PLAIN | POINTERS | structures)[kind.strip()] is of_one, (name, field, ours)


def test_an_array_of_another_type_is_refused_before_it_reaches_fortran():
    doubles, integers = (ctypes.c_double * 2)(), (ctypes.c_int * 2)()
    extrema = loading.load().attrito_extrema
    with pytest.raises(ctypes.ArgumentError):
        extrema(1, 1, Integers(ctypes.addressof(integers)), Doubles(ctypes.addressof(doubles)), None)
    with pytest.raises(ctypes.ArgumentError):
        extrema(1.0, 1, None, None, None)


def test_a_library_of_another_version_is_refused(monkeypatch, tmp_path):
    class Other:
        def __init__(self, *_: object, **__: object) -> None:
            pass

    (tmp_path / "libother.so").touch()
    monkeypatch.setenv("ATTRITO_LIBRARY", str(tmp_path / "libother.so"))
    monkeypatch.setattr(loading.ctypes, "CDLL", Other)
    with pytest.raises(InputError, match=r"libother.so: entry = .*attrito_describe.*: expected the library of"):
        loading.load.__wrapped__()
    monkeypatch.undo()
    monkeypatch.setitem(STRUCTURES, "point", ctypes.c_int)
    with pytest.raises(InputError, match=r"structures = 'of other sizes: point': expected the library of this version"):
        loading.load.__wrapped__()
