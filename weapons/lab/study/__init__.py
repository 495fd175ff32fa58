"""Error against run time: which test is good enough on a scene of the user's own."""
