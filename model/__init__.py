"""Symbolic model: mechanism, moving base, series elastic drive, controller. CasADi expressions only."""
