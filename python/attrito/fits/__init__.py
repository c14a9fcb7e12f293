"""Parameters of a job from measured responses and backbones."""
