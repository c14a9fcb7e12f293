"""What a job file may hold: its tables, their keys, what each key takes, what it is when absent, and what it means.

`docs/reference/job.md` and `attrito keys` are made from these tables (`reference.py`).
"""

from __future__ import annotations

from attrito.job.checks import (
    acceleration,
    boolean,
    choice,
    corner,
    dof,
    either,
    frequency,
    integer,
    listing,
    matrix,
    monitor,
    node_reference,
    number,
    pressure_table,
    stored_point,
    term,
    terms,
    text,
    unit_set,
)
from attrito.job.key import Key
from attrito.job.schema_of_commands import COMMANDS
from attrito.library.names import EIGENSOLVERS, LAWS, ORDERINGS

LAW = {
    "tangential_stiffness": Key(
        number(0, 1e100, above=True), None, "kt: force per relative displacement while it sticks", True
    ),
    "normal_stiffness": Key(number(0, 1e100, above=True), None, "kn: force per approach while it is closed", True),
    "friction_coefficient": Key(
        either(number(0), pressure_table),
        None,
        'mu: \\|T\\| <= mu N; with `law = "pressure"` `[[p, mu], ...]`: linear in p between, constant beyond',
        True,
    ),
    "law": Key(
        choice(*LAWS),
        LAWS[0],
        "`\"pressure\"`: mu depends on the pressure N/A, A a pair's tributary area or a contact's `area`;"
        ' `"iwan"`: sliders in parallel, F_S = mu N and K_T = kt'
        " ([Contact laws](../explanation/contact-laws.md))",
    ),
    "chi": Key(
        number(-1, 0, above=True, below=True),
        None,
        'with `law = "iwan"`: dissipation follows amplitude to the power 3 + chi in microslip',
    ),
    "beta": Key(
        number(0),
        None,
        'with `law = "iwan"`: of kt the part beta/(1 + beta) gives way at once, at macro-slip',
    ),
    "sliders": Key(integer(2, 1000), None, 'with `law = "iwan"`: how many; absent: 20'),
    "gap": Key(number(), 0.0, "N = max(preload + kn (v - gap), 0), v the approach of the two sides"),
    "preload": Key(number(0), 0.0, "normal force without motion; usually 0, since the static load makes it"),
}

TABLES: dict[str, dict[str, Key]] = {
    "model": {
        "file": Key(text, None, "`model.h5` of `attrito import`; or, instead, the matrices:"),
        "mass": Key(
            matrix,
            None,
            'any file that [Bring your model](../how-to/import.md) lists (`"job.pch:MAAX"`: one of several), or rows',
        ),
        "stiffness": Key(matrix, None, "likewise"),
        "damping": Key(matrix, None, "likewise, viscous; may be left out"),
        "gyroscopic": Key(
            matrix,
            None,
            "likewise, of the Coriolis forces in axes that turn, G of M q'' + (C + G) q' + K q = f, skew, at the job's"
            " speed of rotation ([Coriolis forces](../how-to/cyclic.md#coriolis-forces)); may be left out",
        ),
        "gyroscopic_hz": Key(
            frequency(), None, "with `gyroscopic`: the speed that it is of, which `attrito campbell` needs"
        ),
        "suspension_hz": Key(
            frequency(),
            None,
            "of a structure that floats, as one measured free-free: it hangs in springs on which it moves rigidly"
            " at this frequency, (2 pi f)^2 M beside K; far below its first elastic mode"
            " ([Structures that float](../how-to/import.md#structures-that-float))",
        ),
        "units": Key(
            unit_set,
            None,
            'length, mass and time of the model, such as `"mm, t, s"`: names of units in files, pictures and reports;'
            " nothing is converted",
        ),
    },
    "damping": {
        "rayleigh": Key(listing(number(0), 2, 2), None, "`[alpha, beta]`: C = alpha M + beta K"),
        "ratio": Key(
            either(number(-1, 1), listing(number(-1, 1), 1)),
            None,
            "damping ratio of every mode of the system with all contacts stuck; or a list, one of each, ascending in"
            " frequency, the last of all others. Below 0: a flow feeds the mode, `attrito mode` alone"
            " ([Limit cycles](../how-to/limit-cycles.md))",
        ),
        "loss_factor": Key(
            number(0, 1), None, "structural: K (1 + i eta) at harmonics above 0; contact springs do not damp"
        ),
    },
    "reduction": {
        "modes": Key(
            either(integer(0), choice("auto")),
            None,
            '[fixed-interface modes](../explanation/reduction.md) to keep; `"auto"`: as many as `error` asks for',
        ),
        "max_frequency_hz": Key(frequency(), None, "instead of `modes`: keep those up to here"),
        "error": Key(
            number(0, 1, above=True),
            None,
            'with `"auto"`: error of frequencies and point receptances up to the sweep\'s end times harmonics;'
            " absent: a quarter of `[balance] tolerance`, or 0.001",
        ),
        "eigensolver": Key(
            choice(*EIGENSOLVERS),
            EIGENSOLVERS[0],
            "of the fixed-interface modes: SLEPc's Krylov-Schur method, or block Lanczos, quicker on large models"
            " ([Eigensolvers](../evidence/reduction.md#eigensolvers)). Both give the same modes: `rom.h5` of one serves"
            " the other",
        ),
        "ordering": Key(
            choice(*ORDERINGS),
            ORDERINGS[0],
            "of the rows for the factorisation ([Orderings](../evidence/reduction.md#orderings))",
        ),
        "out_of_core": Key(
            either(boolean, choice("auto")),
            "auto",
            "factors on disk, in the folder `MUMPS_OOC_TMPDIR` or `/tmp`: where memory is short, or always, or never",
        ),
        "memory_gb": Key(
            number(0, above=True), None, "that the ranks of a machine may take together; absent: what is free"
        ),
        "recovery": Key(
            either(choice("all", "monitors", "none"), listing(text, 1)),
            "all",
            "nodes whose motion `rom.h5` gives back to `attrito export`, beside those of the boundary: all, those of"
            " monitors, none, or a list of node sets. With thousands of boundary dofs all take gigabytes",
        ),
        "boundary": Key(listing(node_reference), [], "node sets or node ids kept besides the contact nodes"),
        "file": Key(
            text,
            None,
            "the reduced model, used again while matrices and what is asked stay the same, else replaced; absent:"
            " `rom.h5` beside the result or, where that is another, `rom.<8 digits>.h5`"
            " ([Several jobs in a folder](files.md#several-jobs-in-a-folder))",
        ),
    },
    "cyclic": {
        "sectors": Key(integer(1), None, "N: how many of them make the wheel", required=True),
        "engine_order": Key(
            integer(-1000000, 1000000),
            None,
            "EO: above 0 the loads are f_j(t) = f_0(t - j EO T / N) in sector j, below 0 they run the other way round;"
            " harmonic h has the nodal diameter h EO mod N, running backward if that is above N/2",
            required=True,
        ),
        "lower": Key(
            either(text, listing(dof)),
            None,
            "the boundary to the sector before: a node set, whose nodes, turned by 2 pi / N, are those of `upper`; or"
            " dofs in axes that turn with the sector; absent with `upper`: sectors meet in contacts alone",
        ),
        "upper": Key(
            either(text, listing(dof)),
            None,
            "the boundary to the next sector: a node set, or as many dofs as `lower`, in its order",
        ),
        "tolerance": Key(
            number(0),
            None,
            "of node sets: how far a node of `upper` may be from its partner of `lower`, turned by 2 pi / N; absent:"
            " what rounding in a deck leaves. More pairs meshes that are not quite periodic",
        ),
        "on_axis": Key(
            listing(listing(dof, 1, 3)),
            [],
            "where boundaries are lists of dofs: of each node on the axis, which all sectors share, two dofs across it,"
            " the second a quarter turn ahead of the first, and one along it; or the two, or the one"
            " ([Nodes on the axis](../how-to/cyclic.md#nodes-on-the-axis))",
        ),
        "axis_point": Key(listing(number(), 3, 3), None, "on the axis, of node sets"),
        "axis_direction": Key(
            listing(number(), 3, 3), None, "of the axis: the next sector is this one turned by +2 pi / N about it"
        ),
        "interface_modes": Key(
            either(integer(1), choice("all", "auto")),
            "all",
            "with `[reduction]`: all dofs of the boundaries are kept, or as many modes of each nodal diameter span what"
            " they do, or as many as natural frequencies with the error of `[reduction]` ask for"
            " ([Boundaries](../how-to/cyclic.md#boundaries))",
        ),
        "coriolis": Key(
            boolean,
            False,
            "Coriolis forces, at the speed of the centrifugal load, or those of `[model] gyroscopic`"
            " ([Coriolis forces](../how-to/cyclic.md#coriolis-forces))",
        ),
    },
    "static": {
        "load_path": Key(
            listing(corner, 1),
            [0.0, 1.0],
            "corners, followed quasi-statically: one factor on all static loads, or by name",
        ),
        "slider": Key(
            choice("keep", "reset"),
            "keep",
            "start sliders of each point: of the point before, or the static ones; a listed frequency begins at the"
            " static solution then, and is what it is alone",
        ),
        "steps": Key(
            integer(1, 100_000),
            4,
            "increments from corner to corner at least; they are halved until their estimated error is 1e-6 of the"
            " largest normal force ([The static load path](../explanation/load-path.md))",
        ),
        "bounds": Key(
            choice("auto", "sampled", "none"),
            "auto",
            "of points that are not unique: exact where they can be, else sampled at each level from the highest point"
            " down, within a tenth of the work of all points, counted and not timed (`not_examined` beyond it); the"
            ' highest point of each level always. `"sampled"`: of all points, whatever they cost; `"none"`: no bounds,'
            " and no time spent on them ([Points that are not unique](../explanation/uniqueness.md))",
        ),
    },
    "balance": {
        "approach": Key(choice("coupled", "uncoupled"), "coupled", "uncoupled: the mean frozen at the static solution"),
        "harmonics": Key(
            either(integer(1, 1000), choice("auto")),
            None,
            'highest harmonic H; `"auto"`, and absent: at each point what the tolerance asks for, 0.01 unless given',
        ),
        "tolerance": Key(
            number(1e-8, 1),
            None,
            "relative error accepted in the monitors' amplitude: it chooses harmonics where they are not"
            " given, and a point whose estimated error is larger is `above_tolerance`"
            " ([Accuracy](../evidence/accuracy.md))."
            " Absent: 0.01 where harmonics are chosen; with fixed ones the error is estimated, not checked",
        ),
        "quadrature": Key(
            choice("event", "sampled", "auto", "exact"),
            None,
            "has no effect: contacts go by events. Older jobs have it",
            retired="contacts go by events",
        ),
        "samples": Key(
            integer(8, 2**20),
            None,
            "has no effect: contacts go by events. Older jobs have it",
            retired="contacts go by events",
        ),
        "contacts": Key(
            choice("all", "auto"),
            None,
            "has no effect: every pair is solved. Older jobs have it",
            retired="every pair is solved",
        ),
        "residual_tolerance": Key(
            number(1e-14, 1e-3),
            1e-10,
            "norm of the residual relative to the stuck response, or to the alternating motion if that is larger (then"
            " at most 1e-6). The motion's own error is hundreds of times as large"
            " near a peak; below 1e-12 Newton's method takes one step more against that",
        ),
        "max_iterations": Key(integer(1), 30, "of Newton's method"),
    },
    "sweep": {
        "start_hz": Key(frequency(), None, "followed by arc-length from here"),
        "stop_hz": Key(frequency(), None, "to here; or, instead of both:"),
        "frequencies_hz": Key(listing(frequency(), 1), None, "solved one by one, each from the one before"),
        "levels": Key(listing(number(0, above=True), 1), [1.0], "factors on all harmonic loads, a sweep each"),
    },
    "continuation": {
        "branches": Key(
            integer(1),
            1,
            "beyond 1, that many are looked for at each level: from both ends, beyond folds, out of motion in time, by"
            " homotopy in the preload ([Other branches](../explanation/continuation.md#other-branches))",
        ),
        "start": Key(
            stored_point,
            None,
            'a point of an older result, `"point:12"`, to begin at instead of at `start_hz`; with `both_directions`'
            " also from it towards `start_hz`",
        ),
        "start_file": Key(text, None, "that result; absent: the output file as it was"),
        "both_directions": Key(boolean, False, "sweep back too"),
        "curve_tolerance": Key(
            number(1e-8, 1),
            0.01,
            "of the curve drawn through a sweep's points, the cubic between neighbours and their tangents: its distance"
            " from the branch, part of the largest amplitude so far; points are as dense as that needs"
            " ([How long is a step?](../explanation/continuation.md#how-long-is-a-step))",
        ),
        "max_points": Key(
            integer(2),
            1000,
            "of a sweep; one that ends before its stop is reported, in `/points` too, with exit code 1",
        ),
        "locate": Key(
            boolean,
            True,
            "find turning points along sweeps, and where multipliers cross the unit circle if stability is examined"
            " ([Bifurcations](../explanation/stability.md#bifurcations))",
        ),
    },
    **COMMANDS,
    "output": {
        "file": Key(text, None, "result file", required=True),
        "monitors": Key(listing(monitor, 1), None, "weighted sums of dofs that are reported by name", required=True),
    },
}

ARRAYS: dict[str, dict[str, Key]] = {
    "contact": {
        "normal": Key(
            listing(term, 1),
            None,
            "the approach v of the two sides, closing positive; absent: the normal force is `preload` at all times"
            " ([Contact laws](../explanation/contact-laws.md))",
        ),
        "tangents": Key(
            listing(listing(term, 1), 1, 2), None, "the relative displacement u along one or two", required=True
        ),
        "normal_next": Key(
            terms,
            None,
            "with `[cyclic]`, across the boundary: what dofs of the next sector add to `normal`, in its own axes",
        ),
        "tangents_next": Key(
            listing(terms, 1, 2),
            None,
            "what they add to `tangents`, as many; may be empty, as a list is that adds none",
        ),
        **LAW,
        "normal_stiffness": Key(
            number(0, 1e100, above=True), None, "kn: force per approach while it is closed; required with `normal`"
        ),
        "area": Key(number(0, above=True), None, 'with `law = "pressure"`: the area A that N presses'),
    },
    "contact_set": {
        "a": Key(text, None, "node set of one side", required=True),
        "b": Key(text, None, 'node set of the other; may be `"ground"`', required=True),
        "across": Key(
            boolean, False, "with `[cyclic]`: side b is the next sector's, turned by 2 pi / N about the axis"
        ),
        "pairing": Key(
            choice("node", "face"),
            "node",
            "nodes of a with nodes of b, or points of a with the faces of b, whose mesh need not match"
            " ([Contact on faces](../explanation/contact-on-faces.md))",
        ),
        "points": Key(
            choice("node", "gauss", "cut"),
            None,
            'with `pairing = "face"`: nodes of a (when absent), Gauss points of its faces, or of its faces cut at the'
            " edges of b's",
        ),
        "tolerance": Key(
            number(0), None, "largest distance of the two nodes of a pair, or of a point and its face", required=True
        ),
        "tangents": Key(integer(1, 2), 2, "1: slides along one direction, the first tangent"),
        "stiffness_per": Key(
            choice("area", "node"), "area", "stiffness and preload are per tributary area of the pair, or per pair"
        ),
        **LAW,
        "gap": Key(
            either(number(), choice("geometry")),
            0.0,
            'N = max(preload + kn (v - gap), 0), v the approach of the two sides; `"geometry"`: as the mesh has it,'
            " below 0 where the sides overlap",
        ),
        "gap_file": Key(text, None, "added to `gap`: a text file of `node, gap` for nodes of a"),
    },
    "load": {
        "name": Key(text, None, "for `load_path`"),
        "kind": Key(choice("static", "harmonic", "centrifugal"), None, "which of the keys below apply", required=True),
        "dofs": Key(terms, None, "static: forces"),
        "file": Key(text, None, "static, instead of `dofs`: a file ([below](#forces-by-file))"),
        "gravity": Key(
            acceleration,
            None,
            "static, instead of `dofs`: f = M g, the weight, of the acceleration g along x, y, z, or of every dof",
        ),
        "harmonic": Key(integer(1), 1, "harmonic: of the fundamental frequency"),
        "cosine": Key(either(terms, text), [], "harmonic: forces with cos h omega t, or a file of them"),
        "sine": Key(either(terms, text), [], "harmonic: forces with sin h omega t, or a file of them"),
        "base_cosine": Key(
            acceleration,
            None,
            "harmonic: acceleration of the base with cos h omega t, along x, y, z, or of every dof that moves with it;"
            " motion is relative to the base ([below](#base-motion))",
        ),
        "base_sine": Key(acceleration, None, "harmonic: likewise, with sin h omega t"),
        "speed_hz": Key(
            frequency(above=False),
            None,
            "centrifugal: f = Omega^2 M r, r the distance from the axis ([below](#rotation))",
        ),
        "axis_point": Key(listing(number(), 3, 3), None, "centrifugal: on the axis"),
        "axis_direction": Key(listing(number(), 3, 3), None, "centrifugal: of the axis"),
        "spin_softening": Key(
            boolean,
            False,
            "centrifugal: take Omega^2 P M P from the stiffness, P what is across the axis",
        ),
        "coriolis": Key(
            boolean,
            False,
            "centrifugal: Coriolis forces on a whole model; of a sector `[cyclic] coriolis`"
            " ([Coriolis forces](../how-to/cyclic.md#coriolis-forces))",
        ),
    },
}

REQUIRED_TABLES = ("model", "sweep", "output")
LOAD_KEYS = {
    "static": {"name", "kind", "dofs", "file", "gravity"},
    "harmonic": {"name", "kind", "harmonic", "cosine", "sine", "base_cosine", "base_sine"},
    "centrifugal": {"name", "kind", "speed_hz", "axis_point", "axis_direction", "spin_softening", "coriolis"},
}
