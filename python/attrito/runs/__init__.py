"""`attrito run`: points along sweeps and branches, and what is found of each."""
