"""What a monitor's motion may be shown by, and what each is called; apart so that the command line needs no files."""

QUANTITIES = {
    "amplitude": "Amplitude",
    "first_harmonic": "First harmonic",
    "phase": "Phase of the first harmonic",
    "velocity": "Velocity amplitude",
    "acceleration": "Acceleration amplitude",
}
