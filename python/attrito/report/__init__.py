"""`attrito report`: one page about a result."""
