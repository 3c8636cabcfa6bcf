"""Random and damaged input of every kind: each case ends in a result or in one line."""
