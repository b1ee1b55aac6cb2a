"""Proofs of the rounding errors of the elementary functions."""
