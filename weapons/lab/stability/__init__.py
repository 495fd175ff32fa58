"""Numerical stability: how many decisions are wrong on stiff and extreme input, ours and those of others."""
