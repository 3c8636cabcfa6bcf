"""Many throws: batches, sweeps that go on where they stopped, clusters, the best throw."""
