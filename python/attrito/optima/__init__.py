"""Values of a job's keys at which its peaks are least."""
