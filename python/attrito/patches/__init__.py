"""Fewer contacts: pairs of a contact set merged into patches, by an estimate of what that costs."""
