"""numba's options, the cache of compiled code, and addresses in compiled code."""
