"""A job on its model: loads, contacts, reduction; all that is known before the first point."""
