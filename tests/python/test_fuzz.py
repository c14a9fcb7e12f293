"""Malformed input never crashes, hangs or fills the memory; it is told in one message. More of it: `fuzz.py`."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from fuzz import SECONDS, Case, run_cases, told_well

from attrito.support.errors import InputError
from attrito.support.hdf5_reading import stored


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return run_cases(range(40), seed=3)


def test_malformed_input_ends_with_a_message_or_a_result(cases):
    assert [(case.number, case.name, case.breaks, case.message) for case in cases if case.breaks] == []


def test_most_malformed_input_is_refused_and_quickly(cases):
    refused = [case for case in cases if case.code == 2]
    assert len(refused) > len(cases) / 2
    assert max(case.seconds for case in refused) < SECONDS


def test_a_message_names_place_and_remedy():
    assert told_well("attrito: job.toml: [sweep] start_hz = -1: expected at least 0\n")
    assert not told_well("Traceback (most recent call last)\n")
    assert not told_well("attrito: job.toml: [a] b = 1: expected 2\nsomething else\n")


@pytest.mark.parametrize("kind", ["virtual", "external"])
def test_a_dataset_whose_data_lies_elsewhere_is_refused_before_it_is_read(tmp_path, kind):
    path = tmp_path / "model.h5"
    with h5py.File(path, "w") as file:
        if kind == "virtual":
            # HDF5 follows a dataset that is made of itself until the stack ends.
            layout = h5py.VirtualLayout((3,), "f8")
            layout[...] = h5py.VirtualSource("model.h5", "/coordinates", (3,))
            file.create_virtual_dataset("coordinates", layout)
        else:
            file.create_dataset("coordinates", (3,), "f8", external=[("/dev/zero", 0, 24)])
    with pytest.raises(InputError, match="coordinates = 'data in other places'"), stored(path, "a model") as file:
        np.asarray(file["coordinates"])
