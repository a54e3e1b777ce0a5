"""The moves of stage 3, which make a neighbour of a code, and the search that makes them (`search`)."""
