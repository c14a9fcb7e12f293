"""`attrito stress`: stresses of the vibrating structure, and the cycle of a period for fatigue."""
