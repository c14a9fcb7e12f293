"""A full model: its matrices, mesh and surfaces, and what is computed of them without a job."""
