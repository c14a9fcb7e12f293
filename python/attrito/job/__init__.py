"""The job: its schema, reading and checking it."""
