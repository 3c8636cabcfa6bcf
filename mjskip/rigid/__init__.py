"""Rigid bodies: attitude, state, and the kernels of the pure integrator."""
