"""`attrito export`: shapes on the mesh."""
