"""The shot: the call, the choice of a strategy, the pre-filter, areas, hits, and the plan of what ran."""
