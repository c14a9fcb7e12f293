"""`attrito peak`: a resonance peak along a level or a preload."""
