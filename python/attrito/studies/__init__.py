"""`attrito study`: peaks for many values of a job's keys."""
