"""Labels: proposed by rules, drawn by people, compared and audited."""
