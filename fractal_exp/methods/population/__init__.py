"""Methods that keep many codes at a time and draw all of them at once, and what these share."""
