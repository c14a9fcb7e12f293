"""What knows nothing of vibration: errors, files, ranks, signals."""
