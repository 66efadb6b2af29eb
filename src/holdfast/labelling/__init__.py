"""Labels: proposed by rules, drawn by people, reviewed, and written as CSV."""
