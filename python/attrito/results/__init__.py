"""Results on disk: journal, result.h5, tables and quantities."""
