"""The evidence, run by `attrito verify`: a paper reproduced, methods on a grid of scenes, steps of integrators."""
