"""Records of shots that can be replayed, logs of shots, and resumable runs."""
