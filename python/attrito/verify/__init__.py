"""The evidence: `attrito verify` against a paper and on a grid of scenes."""
