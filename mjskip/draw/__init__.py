"""Pictures and films of throws: replayed, never stepped."""
