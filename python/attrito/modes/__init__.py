"""Modes: linear ones of the reference systems, and nonlinear ones followed in their amplitude."""
