"""SOM-MAN: a palette that a self-organising map learns, and an index into it."""
