"""The report of shots as JSON, its picture, and the differences between two reports."""
