"""Figures of a result: `frequency_response`, their `Look`, and `save`, which writes them."""

from attrito.plots.response import frequency_response
from attrito.plots.style import Look, save

__all__ = ["Look", "frequency_response", "save"]
