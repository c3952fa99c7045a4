"""Files broken at random, and what must hold of them; ``make fuzz`` runs it for minutes."""
