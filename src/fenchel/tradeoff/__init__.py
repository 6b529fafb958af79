"""What accuracy costs: measured fronts of a law, of a contact problem, of a scene, and the cheapest setting for what is wanted."""
