"""`attrito chart`: which method finds what of a job."""
