"""`attrito integrate`: motion in time, and what it comes to."""
