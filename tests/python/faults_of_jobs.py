"""Faults of jobs: text, tables, keys and their values."""

from __future__ import annotations

from fault_cases import Case, both, drop, frequencies, in_words, put

NAN, INFINITE = float("nan"), float("inf")


JOB = [
    Case(
        "a line that is not TOML",
        in_words("[sweep]", "[sweep"),
        ("job.toml: file = ", "line ", ": expected a job in TOML"),
    ),
    Case(
        "an unknown table",
        put("continuatoin", branches=1),
        ("job.toml: [continuatoin] = 'unknown table': expected a known table; do you mean continuation?",),
    ),
    Case(
        "an unknown key",
        put("balance", sample=128),
        ("job.toml: [balance] sample = 128: expected a known key; do you mean samples?",),
    ),
    Case(
        "an unknown key of a contact",
        put("contact", 0, stiffness=1.0),
        ("job.toml: contact[0] stiffness = 1.0: expected a known key: normal, tangents, normal_next,",),
    ),
    Case(
        "a table that is a number",
        lambda job: job.update(balance=5),
        ("job.toml: balance = 5: expected a table [balance]",),
    ),
    Case(
        "one table where a list of tables belongs",
        lambda job: job.update(load=job["load"][1]),
        ("job.toml: load = 'dict': expected tables [[load]]",),
    ),
    Case(
        "a text where a number belongs",
        put("contact", 0, normal_stiffness="stiff"),
        ("job.toml: contact[0] normal_stiffness = 'stiff': expected a number above 0",),
    ),
    Case(
        "true where a number belongs",
        put("contact", 0, gap=True),
        ("job.toml: contact[0] gap = True: expected a number",),
    ),
    Case(
        "a negative stiffness",
        put("contact", 0, normal_stiffness=-3.0e5),
        ("job.toml: contact[0] normal_stiffness = -300000.0: expected a number above 0",),
    ),
    Case(
        "a stiffness of zero",
        put("contact", 0, tangential_stiffness=0.0),
        ("job.toml: contact[0] tangential_stiffness = 0.0: expected a number above 0",),
    ),
    Case(
        "a stiffness that is not a number",
        put("contact", 0, tangential_stiffness=NAN),
        ("job.toml: contact[0] tangential_stiffness = nan: expected a number above 0",),
    ),
    Case(
        "an infinite stiffness",
        put("contact", 0, normal_stiffness=INFINITE),
        ("job.toml: contact[0] normal_stiffness = inf: expected a number above 0",),
    ),
    Case(
        "a number beyond all floating point",
        put("contact", 0, normal_stiffness=10**400),
        ("job.toml: contact[0] normal_stiffness = 1000", ": expected a number above 0"),
    ),
    Case(
        "a negative friction coefficient",
        put("contact", 0, friction_coefficient=-0.5),
        ("job.toml: contact[0] friction_coefficient = -0.5: expected a number of at least 0, or pairs [pressure,",),
    ),
    Case(
        "a contact without a friction coefficient",
        drop("contact", 0, "friction_coefficient"),
        ("job.toml: contact[0] friction_coefficient is missing: expected this key to be given",),
    ),
    Case(
        "no harmonics",
        put("balance", harmonics=0),
        ("job.toml: [balance] harmonics = 0: expected an integer from 1 to 1000",),
    ),
    Case(
        "a broken number of harmonics",
        put("balance", harmonics=2.5),
        ("job.toml: [balance] harmonics = 2.5: expected an integer from 1 to 1000",),
    ),
    Case(
        "an integer beyond 32 bits",
        put("continuation", max_points=2**32 + 1),
        ("job.toml: [continuation] max_points = 4294967297: expected an integer from 2 to 2147483647",),
    ),
    Case(
        "a static path without an end",
        put("static", steps=2147483647),
        ("job.toml: [static] steps = 2147483647: expected an integer from 1 to 100000",),
    ),
    Case(
        "a load on a harmonic that is not solved for",
        put("load", 1, harmonic=6),
        ("job.toml: load[1] harmonic = 6: expected a harmonic that is solved for: at most 5",),
    ),
    Case(
        "a sweep that stops where it starts",
        frequencies(start_hz=140.0, stop_hz=140.0),
        ("job.toml: [sweep] stop_hz = 140.0: expected a frequency other than start_hz",),
    ),
    Case(
        "a sweep without its stop",
        frequencies(start_hz=140.0),
        ("job.toml: [sweep] stop_hz is missing: expected start_hz and stop_hz, or frequencies_hz",),
    ),
    Case(
        "listed frequencies beside a sweep",
        put("sweep", start_hz=140.0, stop_hz=100.0),
        (
            "job.toml: [sweep] start_hz = 140.0: expected no such key beside frequencies_hz",
            "job.toml: [sweep] stop_hz = 100.0: expected no such key beside frequencies_hz",
        ),
    ),
    Case(
        "a negative frequency in a list",
        frequencies(frequencies_hz=[132.0, -1.0]),
        (
            "job.toml: [sweep] frequencies_hz = [132.0, -1.0]: expected a number above 0 and of at most 1e+100,"
            " not -1.0, as item 1",
        ),
    ),
    Case(
        "a frequency whose square is beyond all numbers",
        frequencies(frequencies_hz=[1.7e308]),
        (
            "job.toml: [sweep] frequencies_hz = [1.7e+308]: expected a number above 0 and of at most 1e+100,"
            " not 1.7e+308, as item 0",
        ),
    ),
    Case(
        "no sweep at all",
        drop("sweep"),
        ("job.toml: [sweep] is missing: expected a table with start_hz, stop_hz,",),
    ),
    Case(
        "no contact",
        drop("contact"),
        ("job.toml: contact is missing: expected at least one [[contact]] or [[contact_set]]",),
    ),
    Case(
        "no harmonic load",
        drop("load", 1),
        ("job.toml: load is missing: expected at least one [[load]] of kind harmonic",),
    ),
    Case(
        "a harmonic load without terms",
        put("load", 1, cosine=[]),
        ("job.toml: load[1] cosine = []: expected cosine or sine terms",),
    ),
    Case(
        "a load of an unknown kind",
        put("load", 0, kind="thermal"),
        ('job.toml: load[0] kind = \'thermal\': expected one of "static", "harmonic", "centrifugal"',),
    ),
    Case(
        "a key of another kind of load",
        put("load", 0, harmonic=2),
        ("job.toml: load[0] harmonic = 2: expected no such key on a load of kind static",),
    ),
    Case(
        "two loads of one name",
        put("load", 1, name="preload"),
        ("job.toml: load[1] name = 'preload': expected a name that no other load has",),
    ),
    Case(
        "a load path with an unknown load",
        put("static", load_path=[{"preload": 0.0}, {"prelaod": 1.0}]),
        ("job.toml: [static] load_path[1] = 'prelaod': expected names of static loads: preload",),
    ),
    Case(
        "no monitors",
        drop("output", "monitors"),
        ("job.toml: [output] monitors is missing: expected this key to be given",),
    ),
    Case(
        "two monitors of one name",
        put("output", monitors=[{"name": "x", "dofs": [[0, 1.0]]}, {"name": "x", "dofs": [[1, 1.0]]}]),
        ("job.toml: [output] monitors = 'x': expected names that differ",),
    ),
    Case(
        "a monitor with a slash in its name",
        put("output", monitors=[{"name": "tip/x", "dofs": [[0, 1.0]]}]),
        ("job.toml: [output] monitors = [{'name': 'tip/x'", "expected a name of at most 64 bytes without slash"),
    ),
    Case(
        "a dof without its coefficient, deep in a list",
        put("contact", 0, tangents=[[0, 1.0]]),
        ("job.toml: contact[0] tangents = [[0, 1.0]]: expected a pair [dof, coefficient], not 0, as item 0 of item 0",),
    ),
    Case(
        "two kinds of damping",
        both(drop("model", "damping"), put("damping", ratio=0.01, loss_factor=0.01)),
        ("job.toml: [damping] = 'ratio, loss_factor': expected only one kind of damping",),
    ),
    Case(
        "a damping ratio beside a damping matrix",
        put("damping", ratio=0.01),
        ("job.toml: [damping] ratio = 0.01: expected no such key beside the model's own damping matrix",),
    ),
    Case(
        "neither modes nor a frequency for the reduction",
        put("reduction"),
        ("job.toml: [reduction] modes = None: expected either modes or max_frequency_hz",),
    ),
    Case(
        "both modes and a frequency for the reduction",
        put("reduction", modes=1, max_frequency_hz=500.0),
        ("job.toml: [reduction] modes = 1: expected either modes or max_frequency_hz",),
    ),
    Case(
        "nothing to reduce",
        put("reduction", modes=0),
        ("job.toml: [reduction] = 'given': expected none: all 2 dofs are boundary dofs",),
    ),
    Case(
        "a quadrature nobody knows",
        put("balance", quadrature="simpson"),
        ('job.toml: [balance] quadrature = \'simpson\': expected one of "event", "sampled", "auto", "exact"',),
    ),
    Case(
        "harmonics in words",
        put("balance", harmonics="many"),
        ("job.toml: [balance] harmonics = 'many': expected an integer from 1 to 1000, or \"auto\"",),
    ),
    Case(
        "a result to start from without a point of it",
        put("continuation", start_file="older.h5"),
        ("job.toml: [continuation] start_file = 'older.h5': expected no such key but with start",),
    ),
    Case(
        "a tolerance out of reach",
        put("balance", tolerance=1e-9),
        ("job.toml: [balance] tolerance = 1e-09: expected a number of at least 1e-08 and of at most 1",),
    ),
    Case(
        "an error to meet beside a number of modes",
        put("reduction", modes=1, error=0.1),
        ('job.toml: [reduction] error = 0.1: expected no such key but with modes = "auto" or [cyclic]',),
    ),
    Case(
        "an ordering nobody knows",
        put("reduction", modes=1, ordering="metis"),
        ('job.toml: [reduction] ordering = \'metis\': expected one of "scotch", "pord", "amf", "qamd", "amd"',),
    ),
    Case(
        "a word for the factors' place",
        put("reduction", modes=1, out_of_core="maybe"),
        ("job.toml: [reduction] out_of_core = 'maybe': expected true or false, or \"auto\"",),
    ),
    Case(
        "a stability method",
        put("stability", method="floquet"),
        ('job.toml: [stability] method = \'floquet\': expected one of "none", "monodromy", "hill", "both"',),
    ),
    Case(
        "stability of an uncoupled balance",
        lambda job: job.update(stability={"method": "both"}) or job["balance"].update(approach="uncoupled"),
        ("job.toml: [stability] method = 'both': expected \"none\": an uncoupled balance",),
    ),
    Case(
        "stability under a loss factor",
        lambda job: job.update(stability={"method": "hill"}, damping={"loss_factor": 0.01}),
        ("job.toml: [damping] loss_factor = 0.01: expected ratio, rayleigh or a matrix",),
    ),
    Case(
        "a result that would overwrite the job",
        put("output", file="job.toml"),
        ("job.toml: [output] file = 'job.toml': expected a file other than that of the job",),
    ),
    Case(
        "peaks that would overwrite the result",
        put("peak", file="result.h5"),
        ("job.toml: [peak] file = 'result.h5': expected a file other than that of [output] file",),
    ),
    Case(
        "peaks that would overwrite the model where no file for them is named",
        lambda job: job.update(peak={"start": 1.0}) or job["model"].update(mass="result.peaks.h5"),
        ("job.toml: [peak] file = 'result.peaks.h5': expected a file other than that of [model] mass",),
    ),
    Case(
        "a Campbell diagram that would overwrite the result",
        put("campbell", speeds_hz=[1.0], file="result.h5"),
        ("job.toml: [campbell] file = 'result.h5': expected a file other than that of [output] file",),
    ),
    Case(
        "a result that would overwrite one matrix of a file of several",
        lambda job: job["model"].update(mass="result.h5:M"),
        ("job.toml: [output] file = 'result.h5': expected a file other than that of [model] mass",),
    ),
    Case(
        "a result in a folder that is a file",
        put("output", file="result.h5/wedge.h5"),
        ("job.toml: [output] file = 'result.h5/wedge.h5': expected a file in a folder (result.h5 is a file)",),
    ),
    Case(
        "a result that is a folder",
        put("output", file="."),
        ("job.toml: [output] file = '.': expected the name of a file",),
    ),
]
CAMPBELL = [
    Case(
        "a Campbell diagram without speeds",
        put("campbell", modes=3),
        ("job.toml: [campbell] speeds_hz is missing: expected this key to be given",),
    ),
    *(
        Case(
            f"a Campbell diagram {sentence}",
            put("campbell", speeds_hz=speeds),
            (
                f"job.toml: [campbell] speeds_hz = {speeds}: expected a list of at least 1, each a speed in Hz of at"
                " least 0, above the one before",
            ),
        )
        for sentence, speeds in (
            ("of no speed", []),
            ("of a speed that is not finite", [0.0, INFINITE]),
            ("of a speed that is no number", [NAN]),
            ("of a negative speed", [-10.0, 0.0]),
            ("of speeds that do not rise", [10.0, 10.0]),
            ("of one number in place of a list", 10.0),
        )
    ),
    *(
        Case(
            f"a Campbell diagram of {modes} modes",
            put("campbell", speeds_hz=[1.0], modes=modes),
            (f"job.toml: [campbell] modes = {modes}: expected an integer from 1 to 2147483647",),
        )
        for modes in (0, 2.5)
    ),
    Case(
        "engine order 0 in a Campbell diagram",
        put("campbell", speeds_hz=[1.0], engine_orders=[2, 0]),
        ("job.toml: [campbell] engine_orders = [2, 0]: expected an integer from 1 to 1000",),
    ),
    Case(
        "a stiffness at rest that is a number",
        put("campbell", speeds_hz=[1.0], stiffness_at_rest=3.0),
        ("job.toml: [campbell] stiffness_at_rest = 3.0: expected a file name or a list of rows of numbers",),
    ),
]
