"""Compiled kernels (the extra `jit`): the same rows as those in numpy; `common.backend` alone imports them, by name."""
