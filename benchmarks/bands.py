"""Bands by models of few solved samples against those of all samples solved: peaks and whole curves of some scenes.

    .venv/bin/python benchmarks/bands.py out/bands wedge strip --samples 300 --of peaks

Models of the blade, the lap joint and the strip are made as their tutorials say. Every study is a process of its own,
whose processor time is measured. Prints JSON: of each model the relative errors of mean, deviation and quantiles of the
peak; of curves the largest over the frequencies of what is between both, parts of the largest mean amplitude, and how
many frequencies the model calls its own failures; and processor time as part of that of the sampled study.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import common  # isort: skip (sets the threads of BLAS before numpy is loaded)
import h5py
import numpy as np

INPUT = Path(__file__).resolve().parents[1] / "input"
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
FRICTION = {"name": "friction coefficient", "keys": ["contact_set[*].friction_coefficient"], "low": 0.2, "high": 0.4}
PRESS = {"name": "press", "keys": ["static.load_path[1]"], "low": 0.8, "high": 1.2}
# By scene: the job, what of it is set, and what varies
SCENES: dict[str, tuple[str, dict[str, Any], list[dict[str, Any]]]] = {
    "wedge": (
        "wedge.toml",
        {"peak.start": 3.0, "static.load_path": [0.0, 1.0]},
        [
            {"name": "kt", "keys": ["contact[0].tangential_stiffness"], "low": 2.7e5, "high": 3.3e5},
            {"name": "friction", "keys": ["contact[0].friction_coefficient"], "low": 0.4, "high": 0.6},
            {"name": "preload", "keys": ["static.load_path[1]"], "low": 0.9, "high": 1.1},
        ],
    ),
    "strip": ("strip.toml", {"peak.start": 1.0, "static.load_path": [0.0, 1.0]}, [FRICTION, PRESS]),
    "blade": ("blade.toml", {"peak.start": 2.0, "static.load_path": [0.0, 1.0]}, [FRICTION, PRESS]),
    "lap_joint": ("lap_joint.toml", {"peak.start": 0.4}, [FRICTION, PRESS | {"low": 3.6, "high": 4.4}]),
}
# By name: design, and what its second derivatives are made of
MODELS = {
    "gradients": {"design": "second_order"},
    "central_gradients": {"design": "second_order", "hessian": "central_gradients"},
    "values": {"design": "second_order", "hessian": "values"},
    "first_order": {"design": "first_order"},
}
SAMPLED = {"design": "latin_hypercube"}


def solve(folder: Path, scene: str, of: str, samples: int, name: str, keys: dict[str, str]) -> tuple[Path, float, str]:
    """Run a study: its file, processor seconds, and what it said."""
    job, given, vary = SCENES[scene]
    lines = [f'job = "{INPUT / job}"', f'of = "{of}"', f'file = "{name}.h5"', f"samples = {samples}"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in keys.items()]
    for one in vary:
        lines += ["[[vary]]", *(f"{key} = {json.dumps(value)}" for key, value in one.items())]
    (folder / f"{name}.toml").write_text("\n".join(lines) + "\n")
    sets = [f"{key}={json.dumps(value)}" for key, value in given.items()]
    command = [sys.executable, "-m", "attrito.cli", "study", f"{name}.toml"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [*command, *(part for one in sets for part in ("--set", one))],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    path = folder / f"{name}.h5"
    if not path.exists():
        sys.exit(done.stdout + done.stderr)
    return path, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout + done.stderr


def amplitudes(path: Path, of: str) -> np.ndarray:
    """Of all samples, `[samples, frequencies or 1]`; NaN: no solution."""
    with h5py.File(path) as file:
        return file[f"{of}/amplitude"][:]


def errors(sampled: np.ndarray, modelled: np.ndarray) -> dict[str, Any]:
    """Of mean, deviation and quantiles over samples that both have, parts of the largest sampled mean, in percent."""
    both = np.where(np.isfinite(sampled) & np.isfinite(modelled), 1.0, np.nan)
    sampled, modelled = sampled * both, modelled * both
    top = np.nanmax(np.nanmean(sampled, axis=0))

    def worst(one: np.ndarray, other: np.ndarray) -> float:
        return float(100.0 * np.nanmax(np.abs(one - other)) / top)

    bands = [np.nanquantile(values, QUANTILES, axis=0) for values in (sampled, modelled)]
    return {
        "mean": worst(np.nanmean(sampled, axis=0), np.nanmean(modelled, axis=0)),
        "deviation": worst(np.nanstd(sampled, axis=0), np.nanstd(modelled, axis=0)),
        "quantiles": [worst(one, other) for one, other in zip(*bands, strict=True)],
        "band": float(100.0 * np.nanmax(bands[0][-1] - bands[0][0]) / top),
    }


def main() -> None:
    """Each scene sampled, then by every model."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", nargs="+", choices=SCENES)
    parser.add_argument("--samples", type=int, default=300)
    parser.add_argument("--of", choices=("peaks", "response"), default="peaks")
    arguments = parser.parse_args()
    results = {}
    for scene in arguments.scenes:
        folder = arguments.folder / f"{scene}_{arguments.of}"
        folder.mkdir(parents=True, exist_ok=True)
        # Reduces, too: the time of the first study is not counted.
        asked = (folder, scene, arguments.of)
        solve(*asked, arguments.samples, "first_order", MODELS["first_order"])
        path, whole, words = solve(*asked, arguments.samples, "sampled", SAMPLED)
        sampled = amplitudes(path, arguments.of)
        results[scene] = {"seconds": whole, "unsolved": int(np.isnan(sampled).any(axis=1).sum())}
        for name, keys in MODELS.items():
            path, seconds, words = solve(*asked, arguments.samples, name, keys)
            found = errors(sampled, amplitudes(path, arguments.of))
            said = [line for line in words.splitlines() if " model: " in line][:1]
            results[scene][name] = found | {"cost": seconds / whole, "said": said}
    common.report(results)


if __name__ == "__main__":
    main()
