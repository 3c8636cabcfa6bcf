"""Water on bodies of MuJoCo: `attach`, the engine plugin, and what they read from a model."""
