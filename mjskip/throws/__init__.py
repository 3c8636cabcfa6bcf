"""Throws: scenes, engines, recording, trajectories, and MuJoCo against the pure integrator."""
