"""Springline side by side with what one would use instead: the same closed loop, the same machine, one process."""
