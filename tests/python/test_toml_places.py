"""On which line of a job a fault is, and what a misspelt key was meant to be."""

from __future__ import annotations

import pytest

from attrito.job.reading import read_job
from attrito.support.errors import InputError
from attrito.support.toml_places import line_of, places

JOB = """# A comment with [brackets] and key = value
[model]
mass = [[1.0]]                      # [not] = a key
stiffness = [
    [4.0e5],
]

[[contact]]
tangents = [[[0, 1.0]]]
tangential_stifness = 2.0e5
friction_coefficient = 0.4
preload = 50.0
[[contact]]
tangents = [[[0, 1.0]]]
tangential_stiffness = -2.0e5
friction_coefficient = 0.4
preload = 50.0
[[load]]
kind = "harmonc"
cosine = [[0, 1.0]]
[sweep]
start_hz = 130.0
[output]
file = "a [ # text.h5"
monitors = [{ name = "x", dofs = [[0, 1.0]] }]
"""


def faults(text, tmp_path, settings=()):
    (tmp_path / "job.toml").write_text(text)
    with pytest.raises(InputError) as error:
        read_job(tmp_path / "job.toml", settings=settings)
    return str(error.value).replace(f"{tmp_path}/", "").splitlines()


def test_places_are_those_of_tables_and_keys():
    known = places(JOB)
    assert known["model", None, None] == 2 and known["model", None, "stiffness"] == 4
    assert [known["contact", i, None] for i in range(2)] == [8, 13]
    assert known["contact", 1, "tangential_stiffness"] == 15
    assert known["output", None, "monitors"] == 25
    assert not any(name in ("not", "brackets") for name, _, _ in known)
    assert line_of("[sweep] stop_hz", known) == 21 and line_of("contact[1] preload", known) == 17
    assert line_of("nothing[0] at_all", known) == 0


def test_a_fault_has_its_line_and_a_misspelt_key_is_one_fault(tmp_path):
    assert faults(JOB, tmp_path) == [
        "job.toml:10: contact[0] tangential_stifness = 200000.0: expected a known key;"
        " do you mean tangential_stiffness?",
        "job.toml:15: contact[1] tangential_stiffness = -200000.0: expected a number above 0 and of at most 1e+100",
        'job.toml:19: load[0] kind = \'harmonc\': expected one of "static", "harmonic", "centrifugal";'
        ' do you mean "harmonic"?',
        "job.toml:21: [sweep] stop_hz is missing: expected start_hz and stop_hz, or frequencies_hz",
        "4 faults",
    ]


def test_what_a_setting_gave_has_no_line(tmp_path):
    text = JOB.replace("stifness", "stiffness").replace("-2.0", "2.0").replace("harmonc", "harmonic")
    (fault,) = faults(text, tmp_path, ["sweep.start_hz=-1.0", "sweep.stop_hz=95.0"])
    assert fault.startswith("job.toml: [sweep] start_hz = -1.0: expected ")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[balance]\ntolerance = 0.1\nharmonics = -5\n", 3),
        ("balance.harmonics = -5\n", 1),
        ("balance = { harmonics = -5 }\n", 1),
        ('["balance"]\nharmonics = -5\n', 2),
        ('[model]\nunits = """\n[balance]\nharmonics = 3\n"""\n[balance]\nharmonics = -5\n', 7),
        ("# a line\u2028that is one for TOML\n[balance]\nharmonics = -5\n", 3),
        ("[balance]\r\nharmonics = -5\r\n", 2),
    ],
)
def test_a_key_is_found_in_whatever_way_it_is_written(text, line):
    assert line_of("[balance] harmonics", places(text)) == line


def test_a_setting_of_another_table_leaves_the_line(tmp_path):
    text = JOB.replace("stifness", "stiffness").replace("-2.0", "2.0").replace("[sweep]", "[sweep]\nstop_hz = 95.0")
    (fault,) = faults(text, tmp_path, ["load[0].name=push", "contact[*].preload=20.0"])
    assert fault.startswith("job.toml:19: load[0] kind = 'harmonc'")
    (fault,) = faults(text.replace("harmonc", "harmonic"), tmp_path, ["contact[1].preload='much'"])
    assert fault.startswith("job.toml: contact[1] preload = 'much'")


def test_a_misspelt_table_is_one_fault(tmp_path):
    text = JOB.replace("stifness", "stiffness").replace("-2.0", "2.0").replace("harmonc", "harmonic")
    text = text.replace("[sweep]", "[sweep]\nstop_hz = 95.0").replace("[output]", "[ouput]")
    (fault,) = faults(text, tmp_path)
    assert fault == "job.toml:24: [ouput] = 'unknown table': expected a known table; do you mean output?"
