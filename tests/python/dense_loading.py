"""Quasi-static cycles of contacts with two tangents, by roots on all coordinates of the structure: slow, and plain."""

from __future__ import annotations

import numpy as np
from jobs import Job
from scipy.optimize import root


class Loading:
    """A structure under its first static load and alpha M phi; phi has unit modal mass."""

    def __init__(self, job: Job, shape: np.ndarray):
        self._mass, self._stiffness = (np.array(job["model"][name]) for name in ("mass", "stiffness"))
        self._preload, self._push = np.zeros(len(shape)), self._mass @ shape
        self._read(job["load"][0]["dofs"], self._preload)
        self._contacts = job["contact"]
        self._rows = []
        for contact in self._contacts:
            rows = np.zeros((3, len(shape)))
            for row, entries in zip(rows, (*contact["tangents"], contact["normal"]), strict=True):
                self._read(entries, row)
            self._rows.append(rows)

    @staticmethod
    def _read(entries: list, vector: np.ndarray) -> None:
        for dof, value in entries:
            vector[dof] += value

    def _force(self, x: np.ndarray, sliders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """B^T lambda, and where it takes the sliders `[contacts, 2]`: back to the circle of radius mu N / kt."""
        force, moved = np.zeros(len(x)), sliders.copy()
        for i, (contact, rows) in enumerate(zip(self._contacts, self._rows, strict=True)):
            *u, v = rows @ x
            kt, kn, mu = (
                contact[f"{name}"] for name in ("tangential_stiffness", "normal_stiffness", "friction_coefficient")
            )
            press = max(kn * (v - contact.get("gap", 0.0)), 0.0)
            stretch = np.array(u) - sliders[i]
            most = mu * press / kt
            if np.linalg.norm(stretch) > most:
                stretch *= most / np.linalg.norm(stretch)
            moved[i] = np.array(u) - stretch
            force += rows.T @ np.array([*(kt * stretch), press])
        return force, moved

    def cycles(self, load: float, steps: int, most: int) -> tuple[float, float, int]:
        """Q and area of the last of so many cycles, and how many contacts open in it."""
        x, sliders = np.zeros(len(self._preload)), np.zeros((len(self._contacts), 2))
        angle = 2.0 * np.pi * np.arange(steps + 1) / steps
        path = [(1.0, 0.0), *((1.0, load * s) for s in np.sin(angle[1 : steps // 4 + 1]))]
        path += [(1.0, load * c) for _ in range(most) for c in np.cos(angle[1:])]
        coordinates, opened = [], set()
        for number, (static, alpha) in enumerate(path):
            right = static * self._preload + alpha * self._push

            def balance(x, right=right, sliders=sliders):
                return self._stiffness @ x + self._force(x, sliders)[0] - right

            found = root(balance, x, tol=1e-12)
            assert np.linalg.norm(balance(found.x)) < 1e-9 * np.linalg.norm(right), found.message
            x = found.x
            sliders = self._force(x, sliders)[1]
            coordinates.append(self._push @ x)
            if number >= len(path) - steps:
                opened |= {i for i, rows in enumerate(self._rows) if (rows @ x)[2] <= self._contacts[i].get("gap", 0.0)}
        last = np.array(coordinates[-steps - 1 :])
        alpha = load * np.cos(angle)
        return (
            float(np.ptp(last)) / 2.0,
            float(abs(np.sum(0.5 * (alpha[1:] + alpha[:-1]) * np.diff(last)))),
            len(opened),
        )
