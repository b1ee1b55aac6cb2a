"""From symbolic Functions to C, and from C to loaded code."""
