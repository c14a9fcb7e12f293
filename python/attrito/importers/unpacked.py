"""How much packed files make when they are unpacked: a few bytes may stand for more than there is memory for."""

from __future__ import annotations

import contextlib
import lzma
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from attrito.importers.source import refuse

# A MATLAB file of version 5 to 7: bytes before its first variable; tag of a variable that is packed
_MAT_HEAD, _PACKED = 128, 15
# Bytes of a variable that its tag, once unpacked, is in
_START = 256


def most_bytes() -> int:
    """Half of the machine's memory: what is read is copied at least once."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2


def check_zip(path: str, key: str) -> None:
    """Raise unless what a zip archive declares fits into memory; no more than that is unpacked of it."""
    with zipfile.ZipFile(path) as archive:
        _check(path, key, (entry.file_size for entry in archive.infolist()))


def check_mat(path: str, key: str) -> None:
    """The same for the variables of a MATLAB file of version 5 to 7."""
    _check(path, key, _sizes(Path(path)))


@contextlib.contextmanager
def bounded(module: ModuleType, path: str, key: str) -> Iterator[None]:
    """A reader whose `zlib` and `lzma` unpack in the block no more of a file than fits into memory, all together."""
    libraries = {name: getattr(module, name) for name in ("zlib", "lzma")}
    left = most_bytes()

    def decompress(machine: Any, data: bytes) -> bytes:
        nonlocal left
        made: bytes = machine.decompress(data, left + 1)
        left -= len(made)
        if left < 0:
            _check(path, key, iter([most_bytes() - left]))
        if not machine.eof:
            raise ValueError("a packed block ends too early")
        return made

    module.zlib = SimpleNamespace(decompress=lambda data: decompress(zlib.decompressobj(), data))  # type: ignore[attr-defined]
    module.lzma = SimpleNamespace(decompress=lambda data: decompress(lzma.LZMADecompressor(), data))  # type: ignore[attr-defined]
    try:
        yield
    finally:
        for name, library in libraries.items():
            setattr(module, name, library)


def _sizes(path: Path) -> Iterator[int]:
    with path.open("rb") as file:
        file.seek(126)
        order = "<" if file.read(2) == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            end = file.tell() + size
            if kind == _PACKED:
                inner = zlib.decompressobj().decompress(file.read(min(size, _START)), 8)
                yield struct.unpack(f"{order}II", inner)[1] if len(inner) == 8 else 0
            file.seek(end)


def _check(path: str, key: str, sizes: Iterator[int]) -> None:
    size = max(sizes, default=0)
    if size > most_bytes():
        expected = f"at most {most_bytes()}, half of the memory of this machine"
        raise refuse(path, key, f"{size} bytes when it is unpacked", expected)
