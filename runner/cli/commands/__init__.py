"""The commands of `springline`, one module each; cli.py registers them. Heavy imports stay inside the functions."""
