"""Labels: proposed by rules, drawn by people, reviewed, exchanged with other programs."""
